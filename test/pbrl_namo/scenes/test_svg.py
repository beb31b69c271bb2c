"""Drawings become scenes, third-party ones as they are, and nothing of them is dropped silently."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from drawings import BOX, CONFIG, GOAL, drawing, read

from pbrl_control.navigation.footprint import KRANG_STOWED
from pbrl_namo.errors import NamoError
from pbrl_namo.regions import build_roadmap, drive_radius, free_space, openings, region_of
from pbrl_namo.scenes.hidden import scene_yaml
from pbrl_namo.scenes.svg import SvgScene, load_svg, read_svg

DATA = Path(__file__).resolve().parents[2] / "data" / "namo_scenes"


def corners(scene: SvgScene, name: str = "box") -> np.ndarray:
    return np.array(scene.scene.outlines[name].bounds)


def test_a_unit_is_a_centimetre_and_y_points_up() -> None:
    scene = read().scene
    assert scene.room.bounds == pytest.approx((0.0, 0.0, 10.0, 5.0))
    assert corners(read()) == pytest.approx([4.0, 2.5, 5.0, 3.0])
    assert scene.poses["box"] == pytest.approx([4.5, 2.75, 0.0])
    assert math.isnan(scene.movable["box"].mass)
    assert scene.start == pytest.approx([1.0, 4.0, 0.0]) and scene.goal[:2] == pytest.approx([8.0, 1.0])
    assert math.isnan(scene.goal[2]) and scene.robot.radius == pytest.approx(math.hypot(0.2, 0.2))
    assert read().margin == pytest.approx(0.1)


def test_the_scene_with_one_box_is_read_and_closed_to_a_robot_with_its_margin() -> None:
    found = load_svg(DATA / "minimal_stilman_2005.svg")
    scene = found.scene
    assert scene.room.bounds == pytest.approx((0, 0, 1.5186302, 1.4725102))
    assert set(scene.movable) == {"movable_box"} and set(scene.fixed) == {"wall_top", "wall_bottom"}
    assert scene.outlines["movable_box"].area == pytest.approx(0.1511811**2)
    assert scene.start[:2] == pytest.approx([0.16754, 1.19188], abs=1e-4)
    assert scene.goal[:2] == pytest.approx([1.27585, 0.20908], abs=1e-4)
    assert scene.robot.radius == pytest.approx(0.07375, abs=1e-4) and found.margin == pytest.approx(0.03)
    free = free_space(scene, drive_radius(scene.robot, found.margin))
    assert free.index(scene.start) != free.index(scene.goal)
    assert any("CSS pixel" in note for note in found.notes) and any("robot_0" in note for note in found.notes)


def test_the_scene_with_two_boxes_fits_another_robot_and_can_be_planned_in() -> None:
    found = load_svg(DATA / "1_robot_2_obstacles.svg", fit=KRANG_STOWED)
    scene = found.scene
    assert set(scene.movable) == {"box_1", "box_2"} and len(scene.fixed) == 4 and scene.robot is KRANG_STOWED
    drawn = load_svg(DATA / "1_robot_2_obstacles.svg").scene
    factor = scene.room.area / drawn.room.area
    assert factor == pytest.approx((0.5 / drive_radius(drawn.robot, 0.0)) ** 2)
    assert scene.outlines["box_1"].area == pytest.approx(factor * drawn.outlines["box_1"].area)
    free = free_space(scene)
    found_openings = openings(scene, free, build_roadmap(scene, np.random.default_rng(0)))
    start, goal = region_of(scene, free, scene.start), region_of(scene, free, scene.goal, "goal")
    assert start != goal and {o.object for o in found_openings} == {"box_1", "box_2"}
    assert set(scene_yaml(scene, {})["bodies"]) == {*scene.movable, *scene.fixed}


def test_a_scene_over_the_picture_of_a_ros_map_is_refused_in_words() -> None:
    picture = (
        '<g id="map_layer"><image id="i" href="x.png"/></g><g id="movables_layer"><path id="b" d="M0,0h9v9z"/></g>'
    )
    with pytest.raises(NamoError, match="a ROS map with shapes over its picture is another format"):
        read(picture, ends="")


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ('<g transform="translate(100 -50)">{}</g>', [5.0, 3.0, 6.0, 3.5]),
        ('<g transform="scale(2)"><g transform="translate(-200,-100)">{}</g></g>', [4.0, 2.0, 6.0, 3.0]),
        ('<g transform="rotate(90 450 225)">{}</g>', [4.25, 2.25, 4.75, 3.25]),
        ('<g transform="matrix(1 0 0 -1 0 500)">{}</g>', [4.0, 2.0, 5.0, 2.5]),
        ('<g transform="skewX(45)">{}</g>', [6.0, 2.5, 7.5, 3.0]),
        ('<svg x="100" y="50">{}</svg>', [5.0, 2.0, 6.0, 2.5]),
        ('<svg width="500" height="250" viewBox="0 0 1000 500">{}</svg>', [2.0, 3.75, 2.5, 4.0]),
        ('<svg width="500" height="500" viewBox="0 0 1000 500">{}</svg>', [2.0, 2.5, 2.5, 2.75]),
        (
            '<svg width="500" height="500" viewBox="0 0 1000 500" preserveAspectRatio="none">{}</svg>',
            [2.0, 2.5, 2.5, 3.0],
        ),
    ],
)
def test_transforms_and_viewports_are_honoured(content: str, expected: list[float]) -> None:
    assert corners(read(content.format(BOX))) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("head", "factor"),
    [
        ('width="1000cm" height="500cm" viewBox="0 0 1000 500"', 1.0),
        ('width="100cm" height="50cm" viewBox="0 0 1000 500"', 0.1),
        ('width="10000mm" height="5000mm" viewBox="0 0 1000 500"', 1.0),
        ('width="2000" height="1000" viewBox="0 0 1000 500"', 2.0),
        ('width="2000" height="9000" viewBox="0 0 1000 500"', 2.0),
        ('width="500px" viewBox="0 0 1000 500"', 0.5),
        ('width="100%" height="100%" viewBox="0 0 1000 500"', 1.0),
        ('width="26.458333cm" height="13.229166cm" viewBox="0 0 1000 500"', 1.0),
        ('width="1000" height="500"', 1.0),
        ('width="999.99cm" height="500cm" viewBox="0 0 1000 500"', 1.0),
    ],
)
def test_a_scaled_sheet_is_honoured_and_one_unit_a_pixel_means_a_centimetre(head: str, factor: float) -> None:
    found = read(head=head)
    assert found.scene.room.bounds == pytest.approx((0.0, 0.0, 10.0 * factor, 5.0 * factor))
    assert corners(found) == pytest.approx(np.array([4.0, 2.5, 5.0, 3.0]) * factor)
    assert any("is scaled" in note for note in found.notes) == (factor != 1.0)


def test_a_sheet_that_begins_elsewhere_has_its_corner_in_the_origin() -> None:
    found = read(head='viewBox="-100 -50 1000 500"')
    assert corners(found) == pytest.approx([5.0, 2.0, 6.0, 2.5])


@pytest.mark.parametrize(
    ("shape", "area"),
    [
        ('<rect id="box" type="movable" x="400" y="200" width="100" height="50"/>', 0.5),
        ('<rect id="box" type="movable" x="400" y="200" width="100" height="50" rx="25"/>', 0.25 + math.pi * 0.25**2),
        ('<polygon id="box" type="movable" points="400,200 500,200 500,250"/>', 0.25),
        ('<polyline id="box" type="movable" points="400,200 500,200 500,250"/>', 0.25),
        ('<circle id="box" type="movable" cx="400" cy="200" r="50"/>', math.pi * 0.25),
        ('<ellipse id="box" type="movable" cx="400" cy="200" rx="50" ry="20"/>', math.pi * 0.1),
        ('<path id="box" type="movable" d="m400,200 100,0 0,50 -100,0"/>', 0.5),
        ('<path id="box" type="movable" d="M 450,200 a 50,50 0 0 1 0,100 50,50 0 1 1 0,-100"/>', math.pi * 0.25),
        ('<path id="box" type="movable" d="M450 200a50 50 0 010 100 50 50 0 110-100z"/>', math.pi * 0.25),
        ('<path id="box" type="movable" d="M 400,200 C 400,200 500,200 500,200 L 500,250 400,250"/>', 0.5),
        ('<path id="box" type="movable" d="M 400,200 Q 450,300 500,200 Z"/>', 2.0 / 3.0 * 0.5),
        ('<path id="box" type="movable" d="M 400,200 q 25,50 50,0 t 50,0 v 100 h -100 z"/>', 1.0),
        ('<path id="box" type="movable" d="M400 200c0-50 100-50 100 0s-100 50-100 0"/>', 0.6),
        ('<g type="movable"><path id="box" d="M 400,200 H 500 V 250 H 400 Z"/></g>', 0.5),
        ('<g id="movables_layer"><path id="box" d="M 400,200 H 500 V 250 H 400 Z"/></g>', 0.5),
    ],
)
def test_every_kind_of_shape_has_its_area(shape: str, area: float) -> None:
    assert read(shape).scene.outlines["box"].area == pytest.approx(area, rel=5e-3)


def test_walls_with_holes_are_cut_up_and_cover_what_is_drawn() -> None:
    ring = '<path id="ring" type="wall" d="M 0,0 H 1000 V 500 H 0 Z M 20,20 V 480 H 980 V 20 Z"/>'
    scene = read(ring).scene
    assert shapely.union_all(list(scene.fixed.values())).area == pytest.approx(50.0 - 9.6 * 4.6)
    assert all(not piece.interiors for piece in scene.fixed.values())
    assert sum(piece.area for piece in scene.fixed.values()) == pytest.approx(50.0 - 9.6 * 4.6)
    assert free_space(scene).index(scene.start) is not None


def test_a_wall_of_several_parts_is_several_walls_and_a_room_is_the_floor() -> None:
    content = '<path id="w" type="wall" d="M0,0h10v10h-10z M50,0h10v10h-10z"/>'
    content += '<rect id="r" type="room" x="50" width="900" height="450"/>'
    scene = read(content).scene
    assert set(scene.fixed) == {"w_1", "w_2"} and scene.room.bounds == pytest.approx((0.5, 0.5, 9.5, 5.0))


@pytest.mark.parametrize(
    ("robot", "heading"),
    [
        ('<path id="robot_0" angle="90" d="M 80,80 h 40 v 40 h -40 z"/>', math.pi / 2),
        ('<path id="robot_0" orientation="-450" d="M 80,80 h 40 v 40 h -40 z"/>', -math.pi / 2),
        (
            '<g id="robot_0"><path type="shape" d="M 80,80 h 40 v 40 h -40 z"/>'
            '<path type="orientation" d="M 100,100 v -10"/></g>',
            math.pi / 2,
        ),
        ('<path id="robot_0" d="M 80,80 h 40 v 40 h -40 z"/><path id="robot_0_dir" d="m 100,100 -7,0"/>', math.pi),
    ],
)
def test_headings_are_read_wherever_they_are_told(robot: str, heading: float) -> None:
    scene = read(ends=CONFIG + robot + GOAL).scene
    assert math.remainder(scene.start[2] - heading, 2 * math.pi) == pytest.approx(0.0)
    assert shapely.Polygon(scene.robot.at(scene.start)).bounds == pytest.approx((0.8, 3.8, 1.2, 4.2))
    assert not any("heading" in note for note in read(ends=CONFIG + robot + GOAL).notes)


TWO = (
    '<namo_config><agent agent_id="anna"><goal goal_id="a"/><goal goal_id="b"/></agent>'
    '<agent agent_id="ben"><goal goal_id="c"/></agent></namo_config>'
    '<circle id="anna" cx="100" cy="100" r="20"/><circle id="ben" cx="200" cy="100" r="20"/>'
    '<circle id="a" cx="300" cy="300" r="9"/><circle id="b" cx="400" cy="300" r="9"/>'
    '<circle id="c" cx="500" cy="300" r="9"/>'
)


def test_of_several_agents_one_is_named_and_the_others_stand_in_the_way() -> None:
    text = drawing(ends=TWO)
    with pytest.raises(NamoError, match="agent: expected one of 'anna', 'ben', got ''; name one"):
        read_svg(text)
    with pytest.raises(NamoError, match="expected one of 'anna', 'ben', got 'carl'"):
        read_svg(text, agent="carl")
    found = read_svg(text, agent="anna", goal="b")
    assert found.scene.goal[:2] == pytest.approx([4.0, 2.0]) and found.goals == ("a", "b")
    assert set(found.scene.fixed) == {"ben"} and any("'ben' is another robot" in note for note in found.notes)
    assert any("2 goals; the first, 'a'" in note for note in read_svg(text, agent="anna").notes)
    with pytest.raises(NamoError, match="goal of 'anna': expected one of 'a', 'b', got 'c'"):
        read_svg(text, agent="anna", goal="c")


def test_types_alone_tell_robot_and_goal_where_there_is_no_configuration() -> None:
    ends = '<circle id="r" type="robot" cx="100" cy="100" r="20"/><circle id="g" type="goal" cx="300" cy="300" r="9"/>'
    found = read(ends=ends)
    assert found.agent == "r" and found.goals == ("g",) and found.margin == 0.0


def test_what_is_not_understood_is_told() -> None:
    content = (
        BOX
        + '<text id="t">Hi</text><use id="u" href="#box"/><path id="odd" type="sofa" d="M0,0h9v9z"/>'
        + '<path id="plain" d="M0,0h9v9z"/><path id="gone" type="wall" style="display: none" d="M0,0h9v9z"/>'
        + '<circle id="spare" type="goal" cx="9" cy="9" r="3"/><path id="a-b" type="wall" d="M0,0h9v9z"/>'
        + '<path id="over" type="movable" d="M-50,200 h100 v50 h-100 z"/>'
    )
    notes = " ".join(read(content).notes)
    for told in (
        "1 <text> not read: 't'.",
        "1 <use> not read: 'u'.",
        "<path> 'odd' has the unknown type 'sofa', and is left out.",
        "<path> 'plain' has no type, and is left out.",
        "1 <path display=none> not read: 'gone'.",
        "<circle> 'spare' of type 'goal' belongs to no agent",
        "<path> 'a-b' is called 'a_b'.",
        "'over' is partly outside the sheet.",
    ):
        assert told in notes
    assert set(read(content).scene.fixed) == {"a_b"}


def test_ids_that_become_one_name_stay_two_things() -> None:
    content = '<path id="a-b" type="wall" d="M0,0h9v9z"/><path id="a_b" type="wall" d="M20,0h9v9z"/>'
    content += '<path type="wall" d="M40,0h9v9z"/><path id="1" type="movable" d="M60,0h9v9z"/>'
    scene = read(content).scene
    assert set(scene.fixed) == {"a_b", "a_b_2", "wall"} and set(scene.movable) == {"thing_1"}


def test_a_drawing_read_twice_is_one_scene() -> None:
    one, two = load_svg(DATA / "1_robot_2_obstacles.svg"), load_svg(DATA / "1_robot_2_obstacles.svg")
    assert one.notes == two.notes
    assert {n: p.wkb for n, p in one.scene.fixed.items()} == {n: p.wkb for n, p in two.scene.fixed.items()}
    assert one.scene.start.tobytes() == two.scene.start.tobytes()
