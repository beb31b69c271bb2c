"""Offices from a seed: the same again, a way to every goal, and files that the simulator reads."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy import ndimage
from shapely.geometry import Point, Polygon

from bullet_sim.errors import SimError
from bullet_sim.placing import placed_footprint
from pr2_cart_sim.floor_plan import OfficePlan
from pr2_cart_sim.make_office import main, make_office, write_office
from pr2_cart_sim.maps import FREE, GridMap
from pr2_cart_sim.scene import OfficeScene, load_office, office_folder, with_board

SEEDS = range(8)
HALF_WIDTH = 0.40  # [m] of the robot, with a margin


def office(seed: int, **plan: object) -> tuple[GridMap, OfficeScene]:
    grid, scene = make_office(OfficePlan(**plan), seed)
    return grid, OfficeScene.model_validate(scene)


def with_clutter(grid: GridMap, scene: OfficeScene) -> np.ndarray:
    """Cells that are free of walls and of furniture."""
    free = grid.cells == FREE
    for body in scene.clutter.values():
        left, bottom, right, top = placed_footprint(body).bounds
        low = np.floor((np.array([left, bottom]) - grid.origin) / grid.resolution).astype(int)
        high = np.ceil((np.array([right, top]) - grid.origin) / grid.resolution).astype(int)
        free[low[1] : high[1], low[0] : high[0]] = False
    return free


@pytest.mark.parametrize("seed", SEEDS)
def test_there_is_a_way_to_every_goal(seed):
    grid, scene = office(seed)
    clear = ndimage.distance_transform_edt(with_clutter(grid, scene)) * grid.resolution > HALF_WIDTH
    parts, _ = ndimage.label(clear)

    def part(x: float, y: float) -> int:
        row, column = np.floor((np.array([y, x]) - np.array(grid.origin)[::-1]) / grid.resolution).astype(int)
        return int(parts[row, column])

    start = part(*scene.robot.pose[:2])
    assert start > 0
    for name, goal in scene.goals.items():
        assert part(*goal[:2]) == start, name
    assert any(name.startswith("far") for name in scene.goals)


@pytest.mark.parametrize("seed", SEEDS)
def test_people_walk_on_the_floor(seed):
    grid, scene = office(seed, people=12)
    assert len(scene.people) == 12
    for person in scene.people.values():
        route = np.array(person.route)
        for start, end in pairwise(route):
            for share in np.linspace(0, 1, 30):
                assert grid.value(*(start + share * (end - start))) == FREE


def test_furniture_is_not_in_the_map_and_clear_of_walls():
    grid, scene = office(1)
    for name, body in scene.clutter.items():
        middle = placed_footprint(body).centroid
        assert grid.value(middle.x, middle.y) == FREE, name
        assert Polygon(grid.outline).contains(Point(middle))


def test_same_seed_same_office_and_other_seed_another():
    one, two, other = (make_office(OfficePlan(), seed) for seed in (3, 3, 4))
    assert one[1] == two[1]
    np.testing.assert_array_equal(one[0].cells, two[0].cells)
    assert one[1] != other[1]


def test_desks_and_tables_may_be_fixed_to_the_walls_and_nothing_else_changes():
    _, plain = make_office(OfficePlan(), 3)
    _, hung = make_office(OfficePlan(hung=1.0), 3)
    raised = {name for name, body in hung["clutter"].items() if "underside" in body}
    assert raised == {name for name in plain["clutter"] if "_desk_" in name or "_table_" in name}
    for body in hung["clutter"].values():
        assert 0.6 < body.pop("underside", 0.7) < body["height"] or body["kind"] == "block"
    assert hung == plain


@pytest.mark.parametrize("rooms", [2, 3, 7])
def test_small_and_large_offices(rooms):
    _, scene = office(5, rooms=rooms, people=0, movable=0)
    assert len([name for name in scene.goals if name.startswith("n")]) == rooms


def test_written_office_is_read_again(tmp_path):
    path = tmp_path / "mine.yaml"
    write_office(path, OfficePlan(), 2)
    scene = load_office(path)
    assert scene.map == str(tmp_path / "maps" / "mine.yaml")
    assert scene.name == "mine"
    assert len(scene.people) == 5


def test_command_writes_and_refuses_in_a_line(tmp_path, monkeypatch, capsys):
    path = tmp_path / "a.yaml"
    monkeypatch.setattr("sys.argv", ["make_office", str(path), "--people", "2"])
    main()
    assert len(load_office(path).people) == 2
    for key, value in (("rooms", "1"), ("seed", "-1")):
        monkeypatch.setattr("sys.argv", ["make_office", str(path), f"--{key}", value])
        with pytest.raises(SystemExit) as ended:
            main()
        told = capsys.readouterr().err
        assert ended.value.code == 2
        assert told.count("\n") == 1
        assert key in told


@pytest.mark.parametrize("name", sorted(path.stem for path in Path(office_folder()).glob("*.yaml")))
def test_shipped_offices_run(name, make_session, run):
    scene = load_office(name)
    session = make_session(scene.model_copy(update={"people": {}, "sensors": scene.sensors.model_validate({})}))
    run(session, 0.03)
    assert session.contacts == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"clutter": {"cart": None}}, "clutter.cart"),
        ({"people": {"1st": {"route": [[0, 0]]}}}, "expected a name of letters"),
        ({"people": {"ann": {"route": []}}}, "people.ann.route"),
        ({"peopel": {}}, "did you mean 'people'"),
        ({"models": {"cart": "cart.yaml"}}, "models: expected none"),
        ({"robot": {"holds": "cat"}}, "did you mean 'cart'"),
        (
            {"concealed": {"pose_bias": {"cart": {"offset": [0.1, 0]}}}},
            r"concealed\.pose_bias\.cart: expected no fault",
        ),
        ({"concealed": {"time_offset": {"cart": {"delay": 0.1}}}}, r"concealed\.time_offset\.cart: expected no fault"),
        (
            {"sensors": {"checkerboard": {"source": "rendered", "dropout": 0.1}}},
            "checkerboard: expected no dropout where",
        ),
        (
            {"sensors": {"checkerboard": {"source": "rendered", "sigma_xy": 0}}},
            "checkerboard: expected no sigma_xy where",
        ),
    ],
)
def test_a_bad_office_is_one_line(make_scene, tmp_path, change, words):

    whole = make_scene().model_dump(mode="json", exclude_unset=True)
    if "clutter" in change:
        change = {"clutter": {"cart": whole["bodies"]["cart"]}}
    (tmp_path / "bad.yaml").write_text(yaml.safe_dump(whole | change))
    with pytest.raises(SimError, match=words) as caught:
        load_office(tmp_path / "bad.yaml")
    assert "\n" not in str(caught.value)


def test_what_an_office_s_sensors_have_may_be_told(make_scene):
    late = {"left": {"delay": 0.1}}
    assert make_scene(concealed={"time_offset": late}).concealed.time_offset["left"].delay == 0.1
    board = {"source": "rendered", "bias": 0.0, "rate": 5.0}
    assert make_scene(sensors={"checkerboard": board}).sensors.checkerboard.rate == 5.0


def test_unknown_office_and_board_name_the_nearest(make_scene):
    with pytest.raises(SimError, match="did you mean 'office'"):
        load_office("ofice")
    with pytest.raises(SimError, match="did you mean 'rendered'"):
        with_board(make_scene(), "render")
