"""Compiled worlds with contact: Chipmunk without Python is Chipmunk through pymunk, to the last bits."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_model.engines.contact_world import (
    CONTACT_COLUMNS,
    ContactScene,
    contact_scene,
    frame_poses,
    rollout_contact,
    start_states,
)
from pbrl_model.errors import ModelError
from pbrl_model.parameters import BodyParameters
from pbrl_model.world import BodySpec, PhysicsWorld

Array = NDArray[np.float64]

SQUARE = np.array([[-0.3, -0.3], [0.3, -0.3], [0.3, 0.3], [-0.3, 0.3]])
LONG = np.array([[-0.6, -0.3], [0.9, -0.3], [0.9, 0.3], [-0.6, 0.3]])
CORNER = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.2], [0.2, 0.2], [0.2, 1.0], [0.0, 1.0]])
ROOM = np.array([[-2.0, -2.0], [2.5, -2.0], [2.5, 2.2], [-2.0, 2.2]])
BODIES = (
    BodySpec("pusher", SQUARE, BodyParameters(10.0, mu_ground=0.01), np.array([-0.8, 0.0, 0.1]), np.zeros(3), 0.3, 0.4),
    BodySpec("locked", LONG, BodyParameters(20.0, 0.3, 0.2, 0.4, 0.02, 0.5), np.array([0.5, 0.3, 0.2])),
    BodySpec("rod", SQUARE, BodyParameters(5.0, hinge_x=-1.6, hinge_y=1.6, hinge_radius=0.4), np.array([-1.2, 1.6, 0])),
    BodySpec("corner", CORNER, BodyParameters(15.0), np.array([1.2, -1.7, 0.0]), np.array([-0.3, 0.4, 0.2])),
    BodySpec("door", LONG, BodyParameters(8.0, 0.5, hinge_x=-1.0, hinge_y=-1.2, hinge_radius=0.0, mu_y=0.1),
             np.array([-1.0, -1.2, 0.0])),
)  # fmt: skip
STEPS = 250


def pushes(steps: int = STEPS, seed: int = 0) -> Array:
    rng = np.random.default_rng(seed)
    mass = np.array([spec.parameters.mass for spec in BODIES])
    levels = rng.normal(size=(steps // 25, len(BODIES), 3)) * mass[:, None] * [1.5, 1.5, 0.2]
    levels[:, 0, 0] = 40.0
    return np.repeat(levels, 25, axis=0)


def rows_of(specs: tuple[BodySpec, ...] = BODIES) -> Array:
    return np.array([[*s.parameters.to_vector(), s.restitution, s.contact_friction] for s in specs])


def scene_of(specs: tuple[BodySpec, ...] = BODIES, **more: object) -> ContactScene:
    return contact_scene([spec.footprint for spec in specs], [ROOM], **more)  # type: ignore[arg-type]


def start_of(scene: ContactScene, specs: tuple[BodySpec, ...] = BODIES) -> Array:
    return start_states(scene, np.array([s.pose for s in specs]), np.array([s.velocity for s in specs]))


def through_pymunk(wrench: Array, join: tuple[int, int, float] | None = None, iterations: int = 100) -> Array:
    world = PhysicsWorld(0.01, iterations)
    world.add_walls(ROOM)
    for spec in BODIES:
        world.add_body(spec)
    if join:
        world.join(BODIES[join[0]].name, BODIES[join[1]].name, (0.1, 0.2), (-0.2, 0.0), join[2])
    states = [[world.com_state(spec.name) for spec in BODIES]]
    for push in wrench:
        for spec, own in zip(BODIES, push, strict=True):
            world.apply_wrench(spec.name, own)
        world.step()
        states.append([world.com_state(spec.name) for spec in BODIES])
    return np.array(states)


@pytest.mark.parametrize("seed", range(3))
def test_it_is_the_pymunk_world_to_the_last_bits(seed: int) -> None:
    scene, wrench = scene_of(), pushes(seed=seed)
    found = rollout_contact(scene, rows_of(), start_of(scene), wrench)[0]
    reference = through_pymunk(wrench)
    assert np.ptp(reference[:, 1, :2], axis=0).max() > 0.1  # the pusher did move the table that nobody pushes hard
    # Contact is chaotic: had one operation been in another order, metres would lie between the two by now.
    np.testing.assert_allclose(found, reference, rtol=0, atol=1e-9)


@pytest.mark.parametrize("radius", [0.0, 0.9])
def test_joined_bodies_are_joined_as_in_pymunk(radius: float) -> None:
    scene = scene_of(joins=[[0, 2, 0.1, 0.2, -0.2, 0.0, radius]])
    found = rollout_contact(scene, rows_of(), start_of(scene), pushes(100), iterations=40)[0]
    np.testing.assert_allclose(found, through_pymunk(pushes(100), (0, 2, radius), 40), rtol=0, atol=1e-9)


def test_what_was_simulated_before_and_the_number_of_cores_do_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, wrench = scene_of(), pushes(100)
    rows = np.tile(rows_of(), (9, 1, 1))
    rows[:, :, 0] *= np.linspace(0.5, 2.0, 9)[:, None]
    alone = rollout_contact(scene, rows, start_of(scene), wrench, parallel=False)
    monkeypatch.setattr(import_module("pbrl_model.engines.contact_world"), "SERIAL_STEPS", 0)
    assert rollout_contact(scene, rows, start_of(scene), wrench).tobytes() == alone.tobytes()
    backwards = rollout_contact(scene, rows[::-1], start_of(scene), wrench, parallel=False)
    assert backwards[::-1].tobytes() == alone.tobytes()


def test_worlds_may_share_or_own_parameters_starts_and_wrenches() -> None:
    scene = scene_of()
    rows, start, wrench = np.tile(rows_of(), (2, 1, 1)), np.tile(start_of(scene), (2, 1, 1)), pushes(50)
    rows[1, :, 0] *= 2.0
    start[1, 0, 0] -= 0.2
    both = rollout_contact(scene, rows, start, np.stack([wrench, -wrench]))
    for p, sign in enumerate((1.0, -1.0)):
        one = rollout_contact(scene, rows[p], start[p], sign * wrench)
        assert one.shape == (1, 51, 5, 6) and one[0].tobytes() == both[p].tobytes()


def test_wrench_of_the_bodies_turns_with_them() -> None:
    spec = (replace(BODIES[0], velocity=np.array([0.0, 0.0, 1.0])),)
    scene = contact_scene([SQUARE])
    wrench = np.tile([5.0, 0.0, 0.0], (100, 1, 1))
    states = rollout_contact(scene, rows_of(spec), start_of(scene, spec), wrench, body_wrench=True)[0, :, 0]
    turned = np.stack([5.0 * np.cos(states[1:, 2]), 5.0 * np.sin(states[1:, 2]), 0.0 * states[1:, 2]], axis=-1)
    again = rollout_contact(scene, rows_of(spec), start_of(scene, spec), turned[:, None])[0, :, 0]
    np.testing.assert_allclose(states, again, rtol=0, atol=1e-12)


def test_poses_of_frames_come_back() -> None:
    scene = scene_of()
    poses = np.random.default_rng(0).normal(size=(4, 7, 5, 3))
    np.testing.assert_allclose(frame_poses(scene, start_states(scene, poses)), poses, rtol=0, atol=1e-14)


def test_a_motion_that_runs_away_is_an_error_and_not_the_end_of_the_process() -> None:
    scene = scene_of()
    with pytest.raises(ModelError, match="body 0 in world 0 runs away"):
        rollout_contact(scene, rows_of(), start_of(scene), np.full((50, 5, 3), [1e200, 0.0, 0.0]))


def changed(array: Array, index: tuple[int, ...], value: float) -> Array:
    other = array.copy()
    other[index] = value
    return other


COLUMN = {name: k for k, name in enumerate(CONTACT_COLUMNS)}
BAD = {
    "mass": ({"parameters": changed(rows_of(), (1, 0), -1.0)}, "body 1 of world 0"),
    "nan": ({"parameters": changed(rows_of(), (2, 1), np.nan)}, "body 2 of world 0"),
    "restitution": ({"parameters": changed(rows_of(), (0, COLUMN["restitution"]), -0.1)}, "restitution"),
    "columns": ({"parameters": rows_of()[:, :12]}, r"\(P, 5, 14\), got \(1, 5, 12\)"),
    "initial": ({"initial": np.full((5, 6), np.nan)}, "finite initial states"),
    "wrench": ({"wrench": np.full((5, 5, 3), np.inf)}, "finite wrenches"),
    "shape": ({"wrench": np.zeros((5, 4, 3))}, r"\(P, T, 5, 3\)"),
    "worlds": ({"wrench": np.zeros((3, 5, 5, 3)), "initial": np.zeros((2, 5, 6))}, "1 or 3 worlds, got 2"),
    "dt": ({"dt": 0.0}, "dt"),
    "iterations": ({"iterations": 0}, "iteration"),
}


@pytest.mark.parametrize(("fields", "what"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_refused_in_one_line(fields: dict[str, object], what: str) -> None:
    scene = scene_of()
    good = {"parameters": rows_of(), "initial": start_of(scene), "wrench": np.zeros((5, 5, 3))}
    with pytest.raises(ModelError, match=what) as caught:
        rollout_contact(scene, **good | fields)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


BAD_SCENES = {
    "none": ({"footprints": []}, "at least one body"),
    "crossed": ({"footprints": [SQUARE[[0, 2, 1, 3]]]}, "footprint"),
    "wall": ({"walls": [[[0.0, 0.0], [np.nan, 1.0]]]}, "finite walls"),
    "join": ({"joins": [[0, 1, 0, 0, 0, 0, 0.5]]}, "bodies 0..0"),
    "itself": ({"joins": [[0, 0, 0, 0, 0, 0, 0.5]]}, "two bodies"),
    "ragged": ({"joins": [[0, 0, 0]]}, "rows of 7"),
    "properties": ({"properties": []}, "1 mass properties, got 0"),
}


@pytest.mark.parametrize(("fields", "what"), BAD_SCENES.values(), ids=BAD_SCENES.keys())
def test_bad_scenes_are_refused_in_one_line(fields: dict[str, object], what: str) -> None:
    with pytest.raises(ModelError, match=what) as caught:
        contact_scene(**{"footprints": [SQUARE]} | fields)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
