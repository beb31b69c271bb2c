"""Drawings that cannot be taken as they are drawn, or are no drawings: refused by name, in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
from drawings import BOX, CONFIG, GOAL, ROBOT, drawing, read

from pbrl_namo.errors import NamoError
from pbrl_namo.scenes.svg import load_svg, read_svg


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (BOX + BOX, "expected every id once, got 'box' twice"),
        ('<path id="w" type="wall" d="M 0,0 L 100,100"/>', "<path> 'w': expected an outline with an area, got a line"),
        ('<line id="w" type="wall" x1="0" y1="0" x2="9" y2="9"/>', "<line> 'w': expected an outline with an area"),
        ('<path id="w" type="wall" d=""/>', "expected an outline, got none"),
        ('<path id="w" type="wall"/>', "expected an outline, got none"),
        ('<path id="w" type="wall" d="M0,0 100,100 100,0 0,100z"/>', "expected an outline that does not cross itself"),
        ('<path id="w" type="wall" d="M0,0 h100 h-50 z"/>', "expected an outline that does not cross itself"),
        ('<path id="w" type="movable" d="M0,0h9v9z M50,50h9v9z"/>', "expected one outline, got 2"),
        ('<path id="w" type="wall" d="M0,0 h1e999 v9 z"/>', "w <path>: path: expected numbers of at most"),
        ('<path id="w" type="wall" d="M0,0 h1e8 v9 z"/>', "expected coordinates of at most 1000 m"),
        ('<path id="w" type="wall" d="M0,0 hNaN v9 z"/>', "w <path>: path: expected"),
        ('<path id="w" type="wall" d="M0,0 L nan,3 z"/>', "w <path>: path: expected"),
        ('<path id="w" type="wall" d="L0,0 5,5 z"/>', "expected a path that begins with M"),
        ('<path id="w" type="wall" d="M0,0 B 1,2 z"/>', "expected one of the commands"),
        ('<path id="w" type="wall" d="M0,0 L 1"/>', "expected 2 numbers after L, got 1"),
        ('<path id="w" type="wall" d="M0,0 L 1,2 z 3,4"/>', "expected a command, got '3'"),
        ('<path id="w" type="wall" d="M0,0 L 1,2;3,4"/>', "expected a command or a number, got ';3,4'"),
        ('<path id="w" type="wall" d="M0,0' + "h1" * 60_000 + 'z"/>', "expected at most 50000 points"),
        ('<rect id="w" type="wall" width="9in" height="9"/>', "expected units of the drawing, got '9in'"),
        ('<rect id="w" type="wall" width="inf" height="9"/>', "expected a number with"),
        ('<polygon id="w" type="wall" points="1,2,3"/>', "expected pairs of numbers"),
        ('<polygon id="w" type="wall" points="1,2,3,x"/>', "expected numbers of at most"),
        ('<circle id="w" type="wall" cx="0" cy="0"/>', "expected an outline with an area"),
        ('<g transform="rotate(1 2)">' + BOX + "</g>", "transform: expected a known one"),
        ('<g transform="wiggle(1)">' + BOX + "</g>", "transform: expected a known one"),
        ('<g transform="scale(0)">' + BOX + "</g>", "transform: expected one that can be undone"),
        ('<g transform="translate(1e99)">' + BOX + "</g>", "expected numbers of at most"),
        ('<g transform="translate(1) oops">' + BOX + "</g>", "transform: expected matrix"),
        ('<svg viewBox="0 0 10 10">' + BOX + "</svg>", "expected a width and a height beside the viewBox"),
        (
            '<svg viewBox="0 0 9 9" width="9" height="9" preserveAspectRatio="xMinYMin">' + BOX + "</svg>",
            "xMidYMid meet",
        ),
        ("<g>" * 70 + "</g>" * 70, "at most 60 deep"),
    ],
)
def test_what_cannot_be_taken_as_drawn_is_refused_by_name(content: str, message: str) -> None:
    with pytest.raises(NamoError) as caught:
        read(content)
    assert message in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ("", "agent: expected one in namo_config, got none"),
        (CONFIG + ROBOT, "goal: expected one shape with the id 'goal_0'"),
        (CONFIG + GOAL, "robot: expected one shape with the id 'robot_0'"),
        ('<namo_config><agent agent_id="robot_0"/></namo_config>' + ROBOT, "goal of 'robot_0': expected one"),
        (CONFIG + CONFIG + ROBOT + GOAL, "expected one namo_config, got 2"),
        (CONFIG.replace("10", "ten") + ROBOT + GOAL, "cell_size_cm: expected"),
        (CONFIG.replace("10", "-10") + ROBOT + GOAL, "cell_size_cm: expected one length"),
        (CONFIG + ROBOT.replace("type=", 'angle="1 2" type=') + GOAL, "angle: expected one number of degrees"),
        (CONFIG + ROBOT.replace("type=", 'angle="NaN" type=') + GOAL, "angle: expected numbers"),
        (CONFIG + ROBOT + GOAL.replace("20", "0"), "expected an outline with an area"),
    ],
)
def test_a_drawing_without_robot_or_goal_is_refused(ends: str, message: str) -> None:
    with pytest.raises(NamoError) as caught:
        read(ends=ends)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    "head",
    ["", 'viewBox="0 0 0 5"', 'viewBox="0 0 10"', 'viewBox="a b c d"', 'width="1000"', 'viewBox="0 0 1 nan"'],
)
def test_a_sheet_without_a_size_is_refused(head: str) -> None:
    with pytest.raises(NamoError, match="viewBox"):
        read(head=head)


LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>'


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("head", [LAUGHS, "<!DOCTYPE svg>", '<!DOCTYPE x SYSTEM "file:///etc/passwd">'])
def test_document_types_and_entities_are_refused_before_they_do_anything(head: str, encoding: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?>{head}{drawing().decode()}'.encode(encoding)
    with pytest.raises(NamoError, match="expected no document type and no entities"):
        read_svg(text)


@pytest.mark.parametrize(
    "text", [b"", b"hello", b"<svg>", b"\x00\xff", b"<svg/><svg/>", b'<?xml version="1.0" encoding="x"?><a/>']
)
def test_what_is_no_xml_is_refused_in_one_line(text: bytes) -> None:
    with pytest.raises(NamoError, match="expected well-formed XML") as caught:
        read_svg(text)
    assert "\n" not in str(caught.value)


def test_what_is_no_svg_or_no_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NamoError, match="expected an <svg>, got a <html>"):
        read_svg(b"<html/>")
    with pytest.raises(NamoError, match="expected a readable SVG file"):
        load_svg(tmp_path / "none.svg")
    with pytest.raises(NamoError, match="expected a readable SVG file"):
        load_svg(tmp_path)
    with pytest.raises(NamoError, match="expected at most 20 MB"):
        read_svg(b" " * 20_000_001)
