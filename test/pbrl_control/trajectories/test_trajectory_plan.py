"""Trajectory files: the shipped ones load and are what they say, hostile ones are refused in one line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.errors import ControlError
from pbrl_control.planar import compose
from pbrl_control.trajectories.achievable import achievable_trajectory
from pbrl_control.trajectories.trajectory_plan import TrajectoryPlan, load_trajectory
from pbrl_model.parameters import BodyParameters

GRIP = {"gripper": "left", "point": [0.0, 0.0]}
GOOD = {"name": "t", "object": "table", "grips": [GRIP], "waypoints": [[0.5, 0.0, 0.0]]}
SEGMENT = {"twist": [0.1, 0.0, 0.0], "duration": 2.0}
TABLE = np.array([[-0.375, -0.75], [0.375, -0.75], [0.375, 0.75], [-0.375, 0.75]])


def plan_file(folder: Path, **changes: object) -> Path:
    path = folder / "plan.yaml"
    path.write_text(yaml.safe_dump({**GOOD, **changes}))
    return path


def test_every_plan_of_the_workspace_loads_and_is_named_after_its_file(root: Path) -> None:
    paths = sorted((root / "config/params/trajectories").glob("*.yaml"))
    assert {path.stem for path in paths} >= {"straight_and_turn", "turn_about_caster"}
    for path in paths:
        assert load_trajectory(path).name == path.stem


def test_straight_and_turn_ends_where_it_says(root: Path) -> None:
    plan = load_trajectory(root / "config/params/trajectories/straight_and_turn.yaml")
    start = np.array([1.19, -0.25, 0.1])
    end = plan.trajectory(start).end
    np.testing.assert_allclose(end, compose(start, np.array([0.5, 0.0, math.radians(20)])), atol=1e-4)


def test_turn_about_caster_is_what_a_table_with_that_caster_locked_can_do(root: Path) -> None:
    wanted = load_trajectory(root / "config/params/trajectories/turn_about_caster.yaml").trajectory(np.zeros(3))
    wheel = {"wheel_x": -0.315, "wheel_y": -0.69, "mu_x": 0.175, "mu_y": 0.175}
    table = ObjectModel.uniform(BodyParameters(mass=33.0, **wheel), TABLE)
    achieved = achievable_trajectory(wanted, table)
    np.testing.assert_allclose(achieved.at(100.0).pose, wanted.end, atol=1e-3)
    assert wanted.pieces[1].start[2] == pytest.approx(-math.radians(40), abs=1e-3)
    assert wanted.end[2] == pytest.approx(-math.radians(20), abs=1e-3)


def test_waypoints_of_the_world_are_there_whatever_the_start(tmp_path: Path) -> None:
    plan = load_trajectory(plan_file(tmp_path, frame="world"))
    np.testing.assert_allclose(plan.trajectory(np.array([0.3, 0.2, -1.0])).end, [0.5, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"waypoint": []}, "did you mean 'waypoints'?"),
        ({"waypoints": []}, "either waypoints or segments, got neither"),
        ({"segments": [SEGMENT]}, "either waypoints or segments, got both"),
        ({"waypoints": [[0.5, 0.0]]}, "waypoints.0.2"),
        ({"waypoints": [[0.5, math.nan, 0.0]]}, "waypoints.0.1"),
        ({"waypoints": [], "segments": [{**SEGMENT, "twist": [0.5, 0, 0]}]}, "at most 0.15 m/s"),
        ({"waypoints": [], "segments": [{**SEGMENT, "twist": [0, 0, 0]}]}, "twists that move"),
        ({"waypoints": [], "segments": [SEGMENT], "frame": "world"}, "frame: start with segments"),
        ({"frame": "base"}, "frame: "),
        ({"grips": [GRIP] * 2}, "each gripper once"),
        ({"motion": {"speed": -0.1}}, "motion.speed"),
        ({"abort": {"force_ratio": 0.5}}, "abort.force_ratio"),
        ({"follow": {"gain": math.inf}}, "follow.gain"),
    ],
)
def test_a_hostile_plan_is_refused_in_one_line(tmp_path: Path, changes: dict, complaint: str) -> None:
    with pytest.raises(ControlError) as caught:
        load_trajectory(plan_file(tmp_path, **changes))
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_plan_of_no_name_is_refused_with_the_names_there_are() -> None:
    with pytest.raises(ControlError, match=r"expected a path or one of .*turn_about_caster, got 'turn_about_castor'"):
        load_trajectory("turn_about_castor")


def test_plans_do_not_change() -> None:
    plan = TrajectoryPlan.model_validate(GOOD)
    with pytest.raises(ValueError, match="frozen"):
        plan.name = "q"  # type: ignore[misc]


def test_a_start_that_is_no_pose_is_refused() -> None:
    with pytest.raises(ControlError, match="finite poses"):
        TrajectoryPlan.model_validate(GOOD).trajectory(np.full(3, math.nan))
