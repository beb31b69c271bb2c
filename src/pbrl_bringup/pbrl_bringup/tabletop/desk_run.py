"""One desk in one process: the simulator, the camera's eye, the arm's strokes. What a node does with topics, calls do.

Only what the camera or the noisy poses show goes to learner and planner; `truth` is for scoring.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import numpy as np

from bullet_sim.observations import CameraPicture
from pbrl_control.ball_arm import BallArm, Strokes
from pbrl_control.planar import Array, yaw_of
from pbrl_model.tags.calibration import CameraCalibration, calibration
from pbrl_planner.tabletop import Desk, Item, ItemFinder, Push, Sight, Table, TallItem
from pbrl_planner.tabletop.desk import REACH_MARGIN
from pbrl_planner.tabletop.primitives import APPROACH
from tabletop_sim.arm import description_path
from tabletop_sim.scene import DeskScene
from tabletop_sim.session import DeskSession


class DeskRun:
    """A desk, seen and pushed.

    Attributes:
        session: the simulator.
        desk: what may be known of it.
        pushes: made so far.
    """

    def __init__(self, scene: DeskScene, *, seed: int) -> None:
        """Build it.

        Args:
            scene: what to build.
            seed: of the simulator's draws.
        """
        self.session = DeskSession(scene, seed=seed)
        self._arm = BallArm.from_file(description_path(), np.array(scene.arm))
        self._strokes = Strokes(self._arm)
        self.desk = known_desk(scene, self._arm.reach(self._strokes.settings.low))
        heights = {name: item.height for name, item in scene.items.items()}
        tall = [TallItem(item, heights[item.name]) for item in self.desk.items]
        obstacles = [(TallItem(item, heights[item.name]), pose) for item, pose in self.desk.obstacles]
        self._finder = ItemFinder(self.desk.table, tall, obstacles)
        self._seen: dict[str, Array] = {}
        self.pushes = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.session.close()

    def look(self) -> Mapping[str, Array]:
        """Return the poses (3,) of the items that are seen now, by name [m, rad]."""
        shown = self.session.look()
        if isinstance(shown, CameraPicture):
            sight = self._finder.find(shown.image, calibrated(shown), self._seen)
        else:
            poses = {each.tag: np.array([*each.position[:2], yaw_of(each.quaternion)]) for each in shown}
            missing = tuple(name for name in self.desk.names if name not in poses)
            sight = Sight(poses, missing, ())
        self._seen.update(sight.poses)
        return sight.poses

    def push(self, path: Array) -> None:
        """Push along a path (2, 2) of the ball's centre [m], and take the arm out of sight.

        Raises:
            ControlError: a part of it is out of reach.
        """
        stroke = self._strokes.push(self.session.arm.joint_state()[0], path)
        self.session.follow(stroke.joints, stroke.period)
        stroke = self._strokes.stow(self.session.arm.joint_state()[0])
        self.session.follow(stroke.joints, stroke.period)
        self.pushes += 1

    def push_item(self, k: int, push: Push, pose: Array) -> None:
        """Push an item, by its number, that is seen at a pose (3,)."""
        self.push(push.path_in_world(self.desk.items[k], pose, self.desk.effector, APPROACH))

    def layout(self, poses: Mapping[str, Array]) -> Array:
        """Return the layout (n, 3) of poses by name; every item has to be there."""
        return np.array([poses[name] for name in self.desk.names])

    def place(self, layout: Array) -> None:
        """Put the items somewhere (n, 3), as a person would between two trials."""
        for name, pose in zip(self.desk.names, layout, strict=True):
            self.session.world.place(name, pose)
        self._seen = {}

    def truth(self) -> Array:
        """Return where the items truly are (n, 3): for scoring only."""
        return np.array([self.session.world.pose(name) for name in self.desk.names])


def known_desk(scene: DeskScene, reach: tuple[float, float]) -> Desk:
    """Return what may be known of a scene: sizes, obstacles, and how far the ball reaches, least and most [m]."""
    table = Table.of(scene.table.length, scene.table.width)
    items = {name: Item(name, item.length, item.width) for name, item in scene.items.items()}
    movable = tuple(item for name, item in items.items() if not scene.items[name].obstacle)
    obstacles = tuple(
        (item, np.array(scene.items[name].pose)) for name, item in items.items() if scene.items[name].obstacle
    )
    ring = (scene.arm[0], scene.arm[1], reach[0] + REACH_MARGIN, reach[1] - REACH_MARGIN)
    return Desk(table, movable, obstacles, reach=ring)


def calibrated(picture: CameraPicture) -> CameraCalibration:
    """Return the calibration that comes with a picture."""
    lines, width = picture.image.shape
    return calibration(
        picture.frame, (width, lines), picture.matrix, picture.distortion, picture.position, picture.quaternion
    )


def random_layout(desk: Desk, rng: np.random.Generator, room: float = 0.02) -> Array:
    """Draw a layout (n, 3) in which every item keeps some room [m] to all others and can be reached all round."""
    low, high = np.append(desk.table.low, -np.pi), np.append(desk.table.high, np.pi)
    inset = np.array([room, room, 0.0])
    while True:
        layout = np.full((len(desk.items), 3), 1e3)
        for k in range(len(layout)):
            for _ in range(200):
                layout[k] = rng.uniform(low + inset, high - inset)
                if not desk.fault_of(layout, k, room):
                    break
            else:
                break
        else:
            return layout
