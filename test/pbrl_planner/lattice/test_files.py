"""SBPL's files and ROS maps: what was written is read again; what lies is refused by file, line, expected and got."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice import (
    CostGrid,
    Environment,
    GeneratorSettings,
    Lattice,
    LatticeProblem,
    LatticeSettings,
    Motions,
    generate,
    plan,
    read_environment,
    read_map,
    read_primitives,
    write_primitives,
)
from pbrl_planner.lattice.cfg_file import parse_environment
from pbrl_planner.lattice.tokens import Tokens

DATA = Path(__file__).resolve().parents[2] / "data/lattice"
OPTIMAL = 119_407

MPRIM = """resolution_m: 0.1
numberofangles: 4
totalnumberofprimitives: 2
primID: 0
startangle_c: 0
endpose_c: 1 0 0
additionalactioncostmult: 2
intermediateposes: 2
0.0 0.0 0.0
0.1 0.0 0.0
primID: 1
startangle_c: 0
endpose_c: 0 0 -1
additionalactioncostmult: 1
intermediateposes: 2
0.0 0.0 0.0
0.0 0.0 -1.5708
"""
CFG = """discretization(cells): 3 2
obsthresh: 254
cost_inscribed_thresh: 253
cost_possibly_circumscribed_thresh: 128
cellsize(meters): 0.5
nominalvel(mpersecs): 1.0
timetoturn45degsinplace(secs): 2.0
start(meters,rads): 0.1 0.1 0
end(meters,rads): 1.2 0.6 1.57
environment:
0 1 2
3 4 254
"""


@pytest.mark.parametrize("direction", ["backward", "forward"])
def test_a_third_party_s_optimum_is_found_in_its_map_with_its_primitives(direction: str) -> None:
    environment = read_environment(DATA / "cubicle-25mm-inflated-env.cfg.gz")
    assert environment.grid.cells.shape == (473, 436)
    motions = Motions(read_primitives(DATA / "pr2.mprim"), environment.pace)
    problem = LatticeProblem(Lattice(environment.grid, motions), environment.start, environment.goal)
    found = plan(problem, LatticeSettings.model_validate({"direction": direction, "time_limit": 200.0}))
    assert found.cost == OPTIMAL
    assert found.epsilon == 1.0
    assert all(each.cost <= each.epsilon * OPTIMAL + 1e-6 for each in found.history)


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("articulations", [1, 5])
def test_generated_primitives_come_back_from_their_file(tmp_path: Path, articulations: int) -> None:
    made = generate(GeneratorSettings.model_validate({"articulations": articulations}))
    first, second = tmp_path / "a.mprim", tmp_path / "b.mprim"
    write_primitives(made, first)
    again = read_primitives(first)
    write_primitives(again, second)
    assert first.read_bytes() == second.read_bytes()
    assert (again.resolution, again.headings, again.articulations) == (
        made.resolution,
        made.headings,
        made.articulations,
    )
    for a, b in zip(made.primitives, again.primitives, strict=True):
        assert (a.start, a.end, a.multiplier) == (b.start, b.end, b.multiplier)
        assert a.poses.tobytes() == b.poses.tobytes()


def test_a_third_party_s_primitives_come_back_too(tmp_path: Path) -> None:
    made = read_primitives(DATA / "pr2.mprim")
    write_primitives(made, tmp_path / "a.mprim")
    again = read_primitives(tmp_path / "a.mprim")
    for a, b in zip(made.primitives, again.primitives, strict=True):
        assert (a.start, a.end, a.multiplier) == (b.start, b.end, b.multiplier)
        assert np.array_equal(a.poses, b.poses)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("resolution_m: 0.1", "resolution_m: -1", r"line 1: expected resolution_m: a finite number above 0"),
        ("resolution_m: 0.1", "resolution_m: nan", r"line 1: expected resolution_m"),
        ("resolution_m: 0.1\n", "", r"line 1: expected resolution_m:, got 'numberofangles:'"),
        (
            "numberofangles: 4",
            "numberofangles: 100000",
            r"line 2: expected numberofangles: a whole number from 1 to 256",
        ),
        ("primitives: 2", "primitives: 3", r"line 17: expected primID:, got the end of the file"),
        ("primitives: 2", "primitives: 99999999999999999999999", r"line 3: expected totalnumberofprimitives"),
        ("primitives: 2", "primitives: 1", r"line 11: expected the end after 1 primitives, got 'primID:'"),
        ("startangle_c: 0", "startangle_c: 4", r"line 5: expected startangle_c: a whole number from 0 to 3, got '4'"),
        ("endpose_c: 1 0 0", "endpose_c: 1 0 9", r"line 6: expected endpose_c heading"),
        ("endpose_c: 1 0 0", "endpose_c: 1 0 0.5", r"line 6: expected endpose_c heading.*'0.5'"),
        ("endpose_c: 1 0 0", "endpose_c: 5000 0 0", r"line 6: expected endpose_c x"),
        ("endpose_c: 1 0 0", "endpose_c: 2 0 0", r"ends in line 10: expected the last pose at \(0.2, 0\) m"),
        ("endpose_c: 1 0 0", "endpose_c: 1 0 1", r"ends in line 10: expected the last pose to head 1.5708"),
        ("0.1 0.0 0.0", "0.1 0.0 inf", r"line 10: expected pose's heading: a finite number, got 'inf'"),
        (
            "intermediateposes: 2\n0.0 0.0 0.0\n0.1",
            "intermediateposes: 3\n0.0 0.0 0.0\n0.1",
            r"line 11: expected pose's x",
        ),
        ("costmult: 2", "costmult: 0", r"line 7: expected additionalactioncostmult"),
        ("costmult: 2", "costmult: two", r"line 7: .*got 'two'"),
    ],
)
def test_primitives_that_lie_are_refused_by_their_line(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    read_primitives(write(tmp_path, "good.mprim", MPRIM))
    with pytest.raises(PlannerError, match=r"bad\.mprim, .*" + complaint):
        read_primitives(write(tmp_path, "bad.mprim", MPRIM.replace(old, new, 1)))


def test_an_environment_is_read() -> None:
    made = read_environment_of(CFG)
    assert made.grid.cells.tolist() == [[0, 1, 2], [3, 4, 254]]
    assert (made.start, made.goal, made.headings) == ((0.1, 0.1, 0.0), (1.2, 0.6, 1.57), 16)
    assert made.grid.cell_of(1.2, 0.6) == (2, 1)
    assert made.pace.yaw_rate == pytest.approx(math.pi / 8)
    assert read_environment_of(CFG.replace("obsthresh", "NumThetaDirs: 8\nobsthresh", 1)).headings == 8


def read_environment_of(text: str) -> Environment:
    return parse_environment(Tokens(text, "bad.cfg"))


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("cells): 3 2", "cells): 3", r"line 2: expected discretization\(cells\) y"),
        ("cells): 3 2", "cells): 30000000 30000000", r"line 1: expected at most 64000000 cells"),
        ("cells): 3 2", "cells): 8000 8000", r"line 12: expected 64000000 costs .* the end of the file after 6"),
        ("cells): 3 2", "cells): 2 2", r"line 12: expected 4 costs \(2 x 2\), got 6 or more"),
        ("cells): 3 2", "cells): 0 2", r"line 1: expected discretization"),
        ("cellsize(meters): 0.5", "cellsize(meters): 1e-320", r"map: expected a resolution of 1e-06 m at least"),
        ("obsthresh: 254", "obsthresh: 256", r"line 2: expected obsthresh"),
        ("cost_inscribed_thresh: 253\n", "", r"line 3: expected cost_inscribed_thresh:, got"),
        (
            "cellsize(meters): 0.5",
            "cellsize(meters): 0",
            r"line 5: expected cellsize\(meters\): a finite number above 0",
        ),
        ("secs): 2.0", "secs): 0", r"line 7: expected timetoturn45degsinplace"),
        ("secs): 2.0", "secs): 1e-320", r"line 7: expected timetoturn45degsinplace\(secs\): 1e-06 s at least"),
        ("end(meters,rads): 1.2", "end(meters,rads): 1.6", r"expected end\(meters,rads\) on the map of 1.5 x 1 m"),
        ("start(meters,rads): 0.1", "start(meters,rads): -0.1", r"expected start\(meters,rads\) on the map"),
        ("3 4 254", "3 4 256", r"line 12: expected a cost from 0 to 255, got '256'"),
        ("3 4 254", "3 -4 254", r"line 12: expected a cost from 0 to 255, got '-4'"),
        ("environment:", "enviroment:", r"line 10: expected environment:"),
    ],
)
def test_environments_that_lie_are_refused_by_their_line(old: str, new: str, complaint: str) -> None:
    with pytest.raises(PlannerError, match=r"bad\.cfg.*" + complaint):
        read_environment_of(CFG.replace(old, new, 1))


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    for name, data in (("a.cfg", b"\xff\xfe\x00"), ("a.cfg.gz", b"no gzip"), ("b.cfg.gz", b"\x1f\x8b\x08\x00")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(PlannerError, match="expected a readable text file"):
            read_environment(tmp_path / name)
    with pytest.raises(PlannerError, match="expected a readable text file"):
        read_primitives(tmp_path / "none.mprim")


MAP = """image: map.{kind}
resolution: 0.05
origin: [-1.0, 2.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
PIXELS = np.array([[254, 0, 205], [254, 254, 100], [0, 254, 150]], dtype=np.uint8)


def map_file(folder: Path, kind: str = "pgm", more: str = "", pixels: np.ndarray = PIXELS) -> Path:
    cv2.imwrite(str(folder / f"map.{kind}"), pixels)
    return write(folder, "map.yaml", MAP.format(kind=kind) + more)


@pytest.mark.parametrize("kind", ["pgm", "png"])
def test_a_trinary_map_is_read_upside_up(tmp_path: Path, kind: str) -> None:
    found = read_map(map_file(tmp_path, kind))
    assert (found.resolution, found.origin) == (0.05, (-1.0, 2.0))
    # 205 is free by a hair of the usual thresholds, 100 and 150 are unknown.
    expected = [[254, 0, 254], [0, 0, 254], [0, 254, 0]]
    assert found.cells.tolist() == expected
    free = read_map(map_file(tmp_path, kind), unknown="free")
    assert free.cells.tolist() == [[254, 0, 0], [0, 0, 0], [0, 254, 0]]


def test_other_modes_of_a_map(tmp_path: Path) -> None:
    scale = read_map(map_file(tmp_path, more="mode: scale\n"))
    between = [(255 - value) / 255 for value in (150, 100)]
    assert scale.cells[0, 2] == round(252 * (between[0] - 0.25) / 0.4)
    assert scale.cells[1, 2] == round(252 * (between[1] - 0.25) / 0.4)
    raw = read_map(map_file(tmp_path, more="mode: raw\n", pixels=np.array([[0, 50, 100, 255]], dtype=np.uint8)))
    assert raw.cells.tolist() == [[0, 126, 254, 254]]
    negated = map_file(tmp_path)
    negated.write_text(negated.read_text().replace("negate: 0", "negate: 1"))
    assert read_map(negated).cells[0].tolist() == [0, 254, 254]
    clear = np.dstack([PIXELS, PIXELS, PIXELS, np.where(PIXELS == 254, 0, 255).astype(np.uint8)])
    assert (read_map(map_file(tmp_path, "png", pixels=clear)).cells == 254).sum() == 8


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("resolution: 0.05\n", "", "expected resolution: a number above 0"),
        ("resolution: 0.05", "resolution: .nan", "expected resolution"),
        ("resolution: 0.05", "resolution: true", "expected resolution"),
        ("[-1.0, 2.0, 0.0]", "[-1.0, 2.0, 0.5]", "expected an origin with yaw 0"),
        ("[-1.0, 2.0, 0.0]", "nowhere", "expected origin"),
        ("negate: 0", "negate: 2", "expected negate: 0 or 1"),
        ("free_thresh: 0.25", "free_thresh: 0.9", "expected free_thresh at most occupied_thresh"),
        ("free_thresh: 0.25", "free_thrash: 0.9", "expected keys .* got 'free_thrash'"),
        ("free_thresh: 0.25", "mode: lethal", "expected mode"),
        ("image: map.pgm", "image: other.pgm", "expected a readable PGM or PNG image"),
        ("image: map.pgm", "image: map.yaml", "expected a PGM or PNG image, got something else"),
        ("image: map.pgm", "image: 3", "expected image: a file name"),
        ("negate: 0", "negate: 0\nnegate: 1", "there twice"),
    ],
)
def test_maps_that_lie_are_refused(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    path = map_file(tmp_path)
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(PlannerError, match=complaint):
        read_map(path)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (b"P5 90000 90000 255\n\x00", "at most 64000000 pixels, got 90000 x 90000"),
        (b"P5 30 30 255\n\x00", "expected a whole image of 30 x 30"),
        (b"\x89PNG\r\n\x1a\n" + b"\x00\x00\x00\rIHDR" + b"\x00\x10\x00\x00" * 2, "at most 64000000 pixels"),
        (b"P5 # no size", "got something else"),
    ],
)
def test_images_that_lie_are_refused_before_they_are_unpacked(tmp_path: Path, data: bytes, complaint: str) -> None:
    path = map_file(tmp_path)
    (tmp_path / "map.pgm").write_bytes(data)
    with pytest.raises(PlannerError, match=complaint):
        read_map(path)


def test_resampling_is_explicit_and_hides_nothing() -> None:
    rng = np.random.default_rng(1)
    fine = CostGrid(np.where(rng.random((60, 80)) < 0.05, 254, 0).astype(np.uint8), 0.025, (1.0, 1.0))
    for resolution in (0.05, 0.0625, 0.0125):
        again = fine.resampled(resolution)
        assert again.resolution == resolution
        for row, column in np.argwhere(fine.cells == 254):
            x, y = fine.centre_of(int(column), int(row))
            there = again.cell_of(x, y)
            assert again.cells[there[1], there[0]] == 254
    assert (fine.resampled(0.05).cells == fine.cells.reshape(30, 2, 40, 2).max(axis=(1, 3))).all()
    with pytest.raises(PlannerError, match="at most"):
        fine.resampled(1e-5)


def test_a_floor_of_polygons_becomes_cells_and_costs_fall_off() -> None:
    room = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
    table = np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0]])
    grid = CostGrid.of_floor(FloorMap.of(room, {"table": table}), 0.1, near=0.5, nearest=100)
    assert grid.cells.shape == (30, 40)
    assert (grid.cells == 254).sum() == 100
    line = grid.cells[15, 20:28].astype(int)
    assert (np.diff(line) <= 0).all() and line[0] == 80 and line[-1] == 0
    with pytest.raises(PlannerError, match="nearest"):
        CostGrid.of_occupied(np.zeros((3, 3), dtype=bool), 0.1, nearest=253)
    with pytest.raises(PlannerError, match="uint8"):
        CostGrid(np.zeros((3, 3)), 0.1)  # type: ignore[arg-type]
