"""What the executive knows of robot and room, tick by tick, and the scene that it plans in."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping

import numpy as np
from shapely import Polygon

from pbrl_control.errors import ControlError
from pbrl_control.fetching import FetchExecutive
from pbrl_control.fetching.surroundings import Surroundings
from pbrl_control.fetching.whereabouts import Whereabouts
from pbrl_control.kinematics import RobotKinematics
from pbrl_control.percept import BodyShape, Percept, object_planar
from pbrl_control.planar import Array
from pbrl_namo.executive.settings import ExecutiveSettings
from pbrl_namo.executive.step import BasePart, Step, still_held
from pbrl_namo.executive.table import Event
from pbrl_namo.scene import Movable, NamoScene


class RoomView:
    """Where the base is, where things are, and what of that is not known.

    Args:
        kinematics: of the robot.
        settings: patience.

    Attributes:
        where: is the base.
        around: stands what.
        bodies: known geometry by name.
    """

    def __init__(self, kinematics: RobotKinematics, settings: ExecutiveSettings) -> None:
        self._kinematics, self._settings = kinematics, settings
        self._told = False
        self._room: Array | None = None
        self._fixed: dict[str, Array] = {}
        self._masses: dict[str, float] = {}
        self.bodies: Mapping[str, BodyShape] = {}
        self._last_base: Array | None = None
        self.forget()

    def forget(self) -> None:
        """Look anew: who was gone may have put things elsewhere."""
        self.where = Whereabouts(self._kinematics, self._settings.fetch.localizer)
        self.around = Surroundings(self._settings.fetch.smoothing)
        self.around.told(self._room, self._fixed)

    def odometry(self, time: float, pose: Array) -> None:
        """Take in the pose (3,) of `base` in `odom` [m, rad] at a time [s]."""
        self.where.odometry(time, pose)

    def told(self, room: Array | None, fixed: Mapping[str, Array], masses: Mapping[str, float]) -> None:
        """Take in what wears no tag (see `Surroundings.told`), and what things are said to weigh [kg], by name."""
        self._told = True
        self._room, self._fixed, self._masses = room, dict(fixed), dict(masses)
        self.around.told(room, self._fixed)

    def tell(self, fetch: FetchExecutive) -> None:
        """Tell a fetch what wears no tag."""
        fetch.told(self._room, dict(self._fixed))

    def take(self, now: float, percept: Percept) -> None:
        """Take in the latest percept."""
        self.bodies = percept.bodies
        self.where.take(now, percept)
        self.around.take(percept)
        pose = self.where.pose(now)
        self._last_base = self._last_base if pose is None else pose

    def blind(self, now: float) -> list[str]:
        """Return what nothing can be planned without and is not known, in words."""
        missing = ["joint positions"] if self.where.posture() is None else []
        if not self._told:
            missing.append("the scene")
        missing += [f"tag {name!r}" for name in self.around.unplaced()]
        lost = self.where.fault(now)
        return [*missing, f"pose of the base ({lost})"] if lost else missing

    def unseen(self, now: float) -> list[str]:
        """Return which things that may be moved have not been seen lately, but once."""
        names = [name for name in self.bodies if name not in self._fixed and self.around.pose(name) is not None]
        return [name for name in names if self.around.age(name, now) > self._settings.fetch.tag_age]

    def scene(self, now: float, goal: Array, still: Collection[str]) -> NamoScene:
        """Return the scene as it is seen now.

        Args:
            now: [s].
            goal: (3,) in `world`, heading NaN: any [m, rad].
            still: things to be left where they are.

        Raises:
            ControlError: the base's pose is not known, or an outline is no polygon.
            NamoError: a pose is not finite.
        """
        base, floor = self.where.pose(now), self.around.floor()
        if base is None:
            raise ControlError(f"scene: {self.where.fault(now)}; bring the grippers back into a camera's view")
        return self._scene(base, goal, still, floor.room, floor.obstacles)

    def held_scene(self, percept: Percept, name: str, goal: Array) -> NamoScene | None:
        """Return the scene with a thing where its last tag shows it, not where it was on the average of late.

        None where its tag or the base have never been seen.

        Raises:
            ControlError: an outline is no polygon.
            NamoError: a pose is not finite.
        """
        tag = percept.tags.get(name)
        if tag is None or not tag.finite() or self._last_base is None:
            return None
        floor = self.around.floor()
        scene = self._scene(self._last_base, goal, (), floor.room, floor.obstacles)
        return scene.moved({name: object_planar(tag)})

    def _scene(
        self, base: Array, goal: Array, still: Collection[str], room: Polygon, placed: Mapping[str, Polygon]
    ) -> NamoScene:
        free = [name for name in self.bodies if name not in self._fixed and name not in still]
        movable = {
            name: Movable(np.asarray(shape.footprint), shape.height, self._masses.get(name, math.nan))
            for name, shape in self.bodies.items()
            if name in free
        }
        poses = {name: pose for name in free if (pose := self.around.pose(name)) is not None}
        fixed = {name: _corners(polygon) for name, polygon in placed.items() if name not in free}
        return NamoScene.of(_corners(room), fixed, movable, poses, base, goal)


class Look(BasePart):
    """Stands until everything is seen that a plan is made of.

    Args:
        view: to be looked at.
        settings: patience.

    Attributes:
        vanished: things that were not seen although they were waited for: they are taken to stand where they were last.
    """

    def __init__(self, view: RoomView, settings: ExecutiveSettings) -> None:
        self.vanished: tuple[str, ...] = ()
        self._view, self._settings = view, settings
        self._since: float | None = None

    def step(self, now: float, percept: Percept) -> Step:
        """See `Part.step`."""
        self._since = now if self._since is None else self._since
        waited, held = now - self._since, still_held(percept)
        if held:
            return Step(held, Event.STILL_HELD)
        blind = self._view.blind(now) or self._unmapped()
        if blind and waited > self._settings.look_timeout:
            return Step(
                f"look: expected to see everything that driving needs, got none of {'; '.join(blind)} for "
                f"{waited:.1f} s; is its source running?",
                Event.NOT_SEEN,
            )
        if blind or waited < self._settings.look:
            return Step(f"waiting for {blind[0]}" if blind else "looking around")
        unseen = self._view.unseen(now)
        if unseen and waited < self._settings.patience:
            return Step(f"waiting to see tag {unseen[0]!r} again")
        self.vanished = tuple(unseen)
        gone = f"; not seen, so left where they were last: {', '.join(unseen)}" if unseen else ""
        return Step(f"everything needed is seen{gone}", Event.SEEN)

    def _unmapped(self) -> list[str]:
        """Return why no map can be drawn, where it cannot."""
        try:
            self._view.around.floor()
        except ControlError as error:
            return [f"a floor that can be drawn ({error})"]
        return []


def _corners(polygon: Polygon) -> Array:
    return np.array(polygon.exterior.coords)[:-1]
