"""The desk in Bullet: laws of friction under a push, the same bytes from the same seed, hostile scenes and commands."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bullet_sim.errors import SimError
from bullet_sim.observations import CameraPicture, ClockTick, JointStates, KnownScene, TagReading
from bullet_sim.settings import parse_settings
from pbrl_control.ball_arm import BallArm, Strokes
from pbrl_control.planar import placed
from tabletop_sim.arm import STOWED, description_path
from tabletop_sim.scene import DeskScene, load_desk
from tabletop_sim.session import DeskSession


def scene(**items: object) -> DeskScene:
    return parse_settings({"items": items, "vision": {"source": "noise"}}, DeskScene, "test")


BLOCK = {"length": 0.12, "width": 0.06, "height": 0.03, "mass": 0.2, "friction": 0.5, "pose": [0.0, 0.0, 0.3]}


def pushed(session: DeskSession, name: str, begin: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    """Push by a way given in an item's frame; return its pose afterwards."""
    arm = BallArm.from_file(description_path(), np.array(session.world.scene.arm))
    way = placed(np.array([begin, end]), session.world.pose(name))
    stroke = Strokes(arm).push(session.arm.joint_state()[0], way)
    session.follow(stroke.joints, stroke.period)
    return session.world.pose(name)


def test_what_nobody_touches_stays() -> None:
    with DeskSession(load_desk("desk"), seed=1) as session:
        before = {name: session.world.pose(name) for name in session.world.scene.items}
        session.follow(np.array([STOWED] * 200), 0.01)
        for name, pose in before.items():
            np.testing.assert_allclose(session.world.pose(name), pose, atol=1e-5)
            assert session.world.height(name) == pytest.approx(session.world.scene.items[name].height / 2, abs=1e-3)


def test_the_arm_stands_still_where_it_is_stowed() -> None:
    with DeskSession(scene(block=BLOCK), seed=1) as session:
        session.follow(np.array([STOWED] * 100), 0.01)
        angles, rates = session.arm.joint_state()
        np.testing.assert_allclose(angles, STOWED, atol=2e-3)
        np.testing.assert_allclose(rates, 0.0, atol=1e-3)


@pytest.mark.parametrize("mass", [0.05, 0.2, 1.0])
@pytest.mark.parametrize("friction", [0.2, 0.8])
def test_a_slow_push_does_not_depend_on_mass_or_friction(mass: float, friction: float) -> None:
    with DeskSession(scene(block={**BLOCK, "mass": mass, "friction": friction}), seed=1) as session:
        before = session.world.pose("block")
        after = pushed(session, "block", (-0.09, 0.0), (-0.06 - 0.012 + 0.05, 0.0))
        way = after[:2] - before[:2]
        assert way @ [math.cos(0.3), math.sin(0.3)] == pytest.approx(0.05, abs=1.5e-3)
        assert abs(after[2] - before[2]) < 0.05


def test_a_push_beside_the_middle_turns_and_a_mirrored_one_the_other_way() -> None:
    turns = []
    for side in (1.0, -1.0):
        with DeskSession(scene(block=BLOCK), seed=1) as session:
            before = session.world.pose("block")
            after = pushed(session, "block", (0.05 * side, -0.07), (0.05 * side, -0.03 - 0.012 + 0.04))
            turns.append(after[2] - before[2])
    assert turns[0] > 0.25
    assert turns[0] == pytest.approx(-turns[1], abs=0.03)


def test_a_thing_heavy_at_one_end_turns_about_it() -> None:
    heavy = {**BLOCK, "centre": [-0.03, 0.0]}
    with DeskSession(scene(block=heavy), seed=1) as session:
        before = session.world.pose("block")
        after = pushed(session, "block", (0.0, -0.07), (0.0, -0.03 - 0.012 + 0.04))
        assert after[2] - before[2] > 0.3, "the light end goes, the heavy one stays"
        np.testing.assert_allclose(before, [0.0, 0.0, 0.3], atol=1e-6)


def test_an_obstacle_moves_like_anything_else_but_is_not_seen_as_an_item() -> None:
    with DeskSession(scene(punch={**BLOCK, "obstacle": True}), seed=1) as session:
        before = session.world.pose("punch")
        pushed(session, "punch", (-0.09, 0.0), (-0.05, 0.0))
        assert np.hypot(*(session.world.pose("punch") - before)[:2]) > 0.01
        assert session.look() == []


def test_the_same_seed_gives_the_same_bytes() -> None:
    def run(seed: int) -> tuple[bytes, bytes]:
        with DeskSession(load_desk("desk"), seed=seed) as session:
            pushed(session, "eraser", (-0.1, 0.0), (-0.02, 0.0))
            picture = session.look()
            assert isinstance(picture, CameraPicture)
            return session.world.pose("eraser").tobytes(), picture.image.tobytes()

    assert run(3) == run(3)
    first, second = run(3), run(4)
    assert first[0] == second[0], "the physics has no noise of its own"
    assert first[1] != second[1]


def test_observations_come_at_their_rates_and_tell_no_pose_of_items() -> None:
    with DeskSession(load_desk("obstacle"), seed=1) as session:
        news = [each for _ in range(399) for each in session.step()]  # moment 0 is the first step
    counts = {kind: sum(isinstance(each, kind) for each in news) for kind in (ClockTick, JointStates, CameraPicture)}
    assert counts == {ClockTick: 100, JointStates: 100, CameraPicture: 2}
    known = next(each for each in news if isinstance(each, KnownScene))
    told = {body.name: body for body in known.bodies}
    assert told["eraser"].pose.tolist() == [0.0, 0.0, 0.0], "where it stands is for the camera to find out"
    assert told["hole_punch"].pose.tolist() == pytest.approx([0.0, 0.0, math.pi / 2])
    assert not told["hole_punch"].movable
    assert all(math.isnan(body.nominal_mass) for body in known.bodies)


def test_noisy_poses_are_as_noisy_as_told() -> None:
    with DeskSession(scene(block=BLOCK), seed=1) as session:
        seen = []
        for _ in range(300):
            readings = session.look()
            assert isinstance(readings, list)
            assert isinstance(readings[0], TagReading)
            seen.append(readings[0].position[:2])
        np.testing.assert_allclose(np.std(seen, axis=0), 0.001, rtol=0.15)
        session.world.place("block", np.array([9.0, 9.0, 0.0]))
        session.follow(np.array([STOWED] * 50), 0.01)
        assert session.look() == [], "what fell off the table is not seen"


@pytest.mark.parametrize(
    ("items", "words"),
    [
        ({"a": {"kind": "erasor", "pose": [0, 0, 0]}}, "unknown kind 'erasor'.*eraser"),
        ({"a": {"kind": "eraser", "pose": [0, 0, 0], "weight": 1}}, "unknown key"),
        ({"a": {"kind": "eraser", "pose": [0.38, 0, 0]}}, "items.a: expected it wholly on the table"),
        ({"a": {"kind": "eraser", "pose": [0, 0, 0]}, "b": {"kind": "scale", "pose": [0, 0, 0]}}, "they overlap"),
        ({"a": {"kind": "eraser", "pose": [0, float("nan"), 0]}}, "pose"),
        ({"a": {"kind": "box", "pose": [0, 0, 0]}}, "expected a value, got none"),
        ({"a": {**BLOCK, "length": 0.05}}, "the longer side first"),
        ({"a": {**BLOCK, "centre": [0.06, 0.0]}}, "centre"),
        ({"2a": BLOCK}, "expected a name of letters"),
        ({}, "items"),
    ],
)
def test_desks_that_make_no_sense_are_refused_in_a_line(items: dict[str, object], words: str) -> None:
    with pytest.raises(SimError, match=words) as error:
        scene(**items)
    assert "\n" not in str(error.value)


def test_unknown_desks_and_commands_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SimError, match=r"desk 'dest'.*desk"):
        load_desk("dest")
    with pytest.raises(SimError, match="readable YAML"):
        load_desk(tmp_path / "no.yaml")
    with DeskSession(scene(block=BLOCK), seed=1) as session:
        for bad, words in (([0.0], "4 finite"), ([math.nan] * 4, "4 finite"), ([0.0, 9.0, 0.0, 0.0], "arm_shoulder")):
            with pytest.raises(SimError, match=words):
                session.command_joints(bad)
        with pytest.raises(SimError, match="expected one of block"):
            session.world.pose("plate")
