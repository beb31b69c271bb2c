"""Worlds in which a held thing is carried into others: what becomes of them, and what that takes (thesis 6.2.1).

Robot, arms and held thing are one body in them, so heavy that it goes as it is told; the others lie on the floor as
they are believed to, one draw of each a world, and are pushed, turned, or jammed. What slows the heavy body down is the
force that the robot has to find on top of what moves the held thing. The engine is pymunk's, compiled
(`pbrl_model.engines.contact_world`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from pbrl_control.constraints.object_model import ObjectModel
from pbrl_control.navigation.footprint import reaching_arms
from pbrl_control.planar import Array
from pbrl_model.engines.contact_world import ContactScene, contact_scene, frame_poses, rollout_contact, start_states
from pbrl_model.errors import ModelError
from pbrl_model.geometry import MassProperties, mass_properties
from pbrl_model.parameters import BodyParameters
from pbrl_namo.errors import NamoError
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.scene import NamoScene

HEAVY = 1e7
"""[kg] of what goes as it is told."""
STEP, SWEEPS = 0.02, 20
"""[s] of a step, and the solver's sweeps in each."""
SMOOTH = 0.2
"""[s] over which forces are averaged: two hard bodies that meet have one of a single step."""
RAMP, REST = 0.5, 0.4
"""[s] in which it sets out and stops, and that is waited for others to come to rest."""
RESTITUTION, CONTACT_FRICTION = 0.0, 0.3
"""Of furniture."""
SEAM = 0.005
"""[m] by which robot, arms and thing are joined where they only touch."""


@dataclass(frozen=True)
class Carried:
    """What became of everything, world by world.

    Attributes:
        poses: (w, 3) of each other thing in `world` at the end, by name [m, rad].
        force: (w,) greatest that others put on what is carried [N].
        end: (3,) of what is held in `world` [m, rad].
    """

    poses: Mapping[str, Array]
    force: Array
    end: Array

    def moved(self, name: str, pose: Array) -> NDArray[np.bool_]:
        """Say in which worlds (w,) a thing is no longer at a pose (3,)."""
        away = self.poses[name] - pose
        moved: NDArray[np.bool_] = (np.hypot(away[:, 0], away[:, 1]) > SEAM) | (np.abs(away[:, 2]) > SEAM)
        return moved


class ContactWorlds:
    """Worlds of one scene with one thing held.

    Args:
        scene: things where they stand.
        name: of what is held.
        models: physics of each other thing that may be touched, by name, one for each of w worlds; what is not named
            stands as walls do.
        settings: of what the grippers can do.

    Raises:
        NamoError: the things have different numbers of worlds, or there is none.
    """

    def __init__(
        self,
        scene: NamoScene,
        name: str,
        models: Mapping[str, Sequence[ObjectModel]],
        settings: ManipulationSettings,
    ) -> None:
        counts = {len(each) for each in models.values()}
        if len(counts) != 1 or 0 in counts or name in models:
            raise NamoError(f"contact worlds: expected as many of each other thing, one at least, got {sorted(counts)}")
        self._scene, self._name, self._others = scene, name, tuple(models)
        still = [scene.outlines[each] for each in scene.movable if each != name and each not in models]
        rings = [scene.room.exterior, *scene.room.interiors]
        solid = [*scene.fixed.values(), *still]
        self._walls = [np.asarray(ring.coords)[:-1, :2] for ring in (*rings, *(each.exterior for each in solid))]
        self._rows = np.array(
            [
                [[*model.parameters.to_vector(), RESTITUTION, CONTACT_FRICTION] for model in world]
                for world in zip(*models.values(), strict=True)
            ]
        )
        self._arms = reaching_arms(settings.grasping.home[1])
        self._held: dict[bytes, tuple[ContactScene, ContactScene, MassProperties]] = {}

    def carry(self, base: Array, motions: Sequence[tuple[Array, float]]) -> Carried:
        """Carry the held thing along.

        Args:
            base: (3,) of the base that holds it, in its frame [m, rad].
            motions: twist (3,) of its origin in its axes [m/s, rad/s] and for how long [s], one after the other.

        Raises:
            NamoError: some world cannot be followed, or the arms do not reach the thing.
        """
        place, free, told = self._with(base)
        scene, others = self._scene, self._others
        heavy = BodyParameters(mass=HEAVY, mu_ground=0.0).to_vector()
        count = len(self._rows)
        rows = np.concatenate((self._rows, np.tile([*heavy, 0.0, CONTACT_FRICTION], (count, 1, 1))), axis=1)
        poses = np.array([*(scene.poses[each] for each in others), scene.poses[self._name]], dtype=float)
        state = np.repeat(start_states(place, poses)[None], count, axis=0)
        peak = np.zeros(count)
        for twist, duration in motions:
            vx, vy, turn = (float(value) for value in twist)
            own = np.array([vx - turn * told.com[1], vy + turn * told.com[0]])  # of its centre of mass, in its axes
            share = _trapeze(duration)
            wrench = np.zeros((len(share) - 1, len(poses), 3))
            faster, middle = np.diff(share) / STEP, 0.5 * (share[1:] + share[:-1])
            inwards = turn * np.array([-own[1], own[0]])  # keeps it on its circle
            wrench[:, -1, :2] = HEAVY * (faster[:, None] * own + middle[:, None] ** 2 * inwards)
            wrench[:, -1, 2] = HEAVY * told.inertia_per_mass * faster * turn
            try:
                rolled = rollout_contact(place, rows, state, wrench, STEP, iterations=SWEEPS, body_wrench=True)
                alone = rollout_contact(free, rows[0, -1:], state[0, -1:], wrench[:, -1:], STEP, body_wrench=True)
            except ModelError as error:
                raise NamoError(f"contact worlds: {error}") from error
            peak = np.maximum(peak, _slowing(rolled[:, :, -1], alone[0, :, 0]))
            state = rolled[:, -1].copy()
            state[:, :, 3:] = 0.0
        ends = frame_poses(place, state)
        return Carried({each: ends[:, k] for k, each in enumerate(others)}, peak, ends[0, -1])

    def _with(self, base: Array) -> tuple[ContactScene, ContactScene, MassProperties]:
        """Return everything and what is held by a base (3,), the latter alone, and how its mass lies."""
        key = np.asarray(base, dtype=float).tobytes()
        if key not in self._held:
            outline = self._outline(base)
            told = mass_properties(outline)
            things = [*(self._scene.movable[each].footprint for each in self._others), outline]
            place = contact_scene(things, self._walls, properties=[*(None for _ in self._others), told])
            self._held[key] = place, contact_scene([outline], properties=[told]), told
        return self._held[key]

    def _outline(self, base: Array) -> Array:
        """Return the outline (k, 2) of robot, arms and what they hold, in the thing's frame."""
        parts = [shapely.Polygon(part.at(base)) for part in (self._scene.robot, self._arms)]
        parts.append(shapely.Polygon(self._scene.movable[self._name].footprint))
        whole = shapely.union_all([part.buffer(SEAM, join_style="mitre") for part in parts])
        if not isinstance(whole, shapely.Polygon):
            raise NamoError(f"contact worlds: expected arms that reach {self._name!r}, they do not")
        return np.asarray(whole.exterior.simplify(SEAM).coords)[:-1]


def _trapeze(duration: float) -> Array:
    """Return shares (t + 1,) of a velocity at the ends of steps: up, for so long that the way is done [s], and down."""
    ramp = max(1, round(min(RAMP, duration) / STEP))
    full = max(0, round(duration / STEP) - ramp)
    up = np.linspace(0.0, 1.0, ramp + 1)
    return np.concatenate((up, np.ones(full), up[-2::-1], np.zeros(max(1, round(REST / STEP)))))


def _slowing(states: Array, alone: Array) -> Array:
    """Return the greatest force (w,) that others put on what is heavy, along its states (w, t, 6) [N].

    Args:
        states: of its centre of mass.
        alone: (t, 6) the same if there were nothing else.
    """
    driven = np.diff(alone[:, 3:5], axis=0)
    aside = states[:, 1:, 2] - alone[1:, 2]  # what drives it turns with it
    c, s = np.cos(aside), np.sin(aside)
    own = np.stack((c * driven[:, 0] - s * driven[:, 1], s * driven[:, 0] + c * driven[:, 1]), axis=-1)
    taken = HEAVY * (np.diff(states[..., 3:5], axis=1) - own) / STEP
    width = min(max(1, round(SMOOTH / STEP)), taken.shape[1])
    summed = np.cumsum(np.concatenate((np.zeros_like(taken[:, :1]), taken), axis=1), axis=1)
    mean = (summed[:, width:] - summed[:, :-width]) / width
    return np.asarray(np.hypot(mean[..., 0], mean[..., 1]).max(axis=1))
