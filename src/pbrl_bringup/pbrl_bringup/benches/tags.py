"""How well tags say where things are: found in rendered pictures of six cameras, and made by the model of their noise.

Each trial furnishes a room anew: a table anywhere, Krang anywhere in one of its postures, and cameras calibrated anew.
Both ways are asked once, and compared with where table and grippers truly are. `figure.png` shows a camera's picture
with what was found in it, and the errors of both.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from bullet_sim.client import BulletClient, Pose
from bullet_sim.concealed.sensing import tag_camera
from bullet_sim.scene import Scene, load_scene
from bullet_sim.world import World
from krang_sim.observations import CameraPicture
from krang_sim.postures import POSTURES, posture
from krang_sim.robot import SIDES, Krang
from krang_sim.tag_cameras import TagCameras
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.paths import config_file
from pbrl_bringup.rendered_tags import as_picture, tag_reader
from pbrl_model.tags.reader import TagReader
from pbrl_model.tags.sheet import load_tag_sheet, worn_tags

Array = NDArray[np.float64]

TRIALS, QUICK_TRIALS = 120, 12
PLACE, YAW = 0.005, np.deg2rad(1.0)
"""Goals of the issue at table height [m], [rad]."""
ROOM = ((-1.5, -3.5), (5.5, -3.5), (5.5, 3.5), (-1.5, 3.5))
"""As in the scene three_tables [m]."""
FROM_WALLS, APART = 1.0, 1.9
"""Least distance of table and robot from a wall and from each other, middle to middle [m]."""
TABLE = {"kind": "office_table", "size": [0.75, 1.5], "height": 0.7775, "nominal_mass": 33.0}
LATER = 10.0
"""When every picture has arrived [s]."""
SHOWN = "free_table"
"""Scene of the picture in the figure."""
MISREAD = 0.1
"""A reading further off than this is of another tag [m]."""
WAYS = ("rendered", "pictures alone", "noise")
"""Pictures alone: read by somebody who knows exactly where the cameras hang."""
KINDS = ("table", "gripper")


@dataclass(frozen=True)
class Reading:
    """One body, read one way.

    Attributes:
        way: of `WAYS`.
        kind: of `KINDS`.
        error: (4,) x, y, z [m] and yaw [rad] against the truth; NaN where it was not read.
        tilt: angle between the axis read and the true one [rad].
    """

    way: str
    kind: str
    error: Array
    tilt: float


@dataclass(frozen=True)
class Trial:
    """One furnished room.

    Attributes:
        readings: of every body in every way.
        taking: CPU time of the simulator for one picture of each camera [s].
        reading: CPU time for finding tags in them and solving [s].
        pictures: how many that were.
    """

    readings: list[Reading]
    taking: float
    reading: float
    pictures: int


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Furnish rooms and read tags in them."""
    seeds = np.random.SeedSequence(seed).spawn(QUICK_TRIALS if quick else TRIALS)
    trials = [run_trial(np.random.default_rng(each)) for each in seeds]
    figure(trials, *photograph(np.random.default_rng(seed))).savefig(out / "figure.png", dpi=100)
    return Measured(rows_of(trials), {"errors": summary(trials)})


def furnished(rng: np.random.Generator) -> Scene:
    """Draw a room: a table and Krang anywhere that is not in the other's way.

    Args:
        rng: draws places, headings and the posture.
    """
    low, high = np.min(ROOM, axis=0) + FROM_WALLS, np.max(ROOM, axis=0) - FROM_WALLS
    table, robot = rng.uniform(low, high), rng.uniform(low, high)
    while np.hypot(*(table - robot)) < APART:
        table, robot = rng.uniform(low, high), rng.uniform(low, high)
    turns = rng.uniform(-np.pi, np.pi, 2)
    return Scene.model_validate(
        {
            "room": {"outline": ROOM},
            "robot": {"pose": (*robot, turns[0]), "posture": str(rng.choice(sorted(POSTURES)))},
            "bodies": {"table": {**TABLE, "pose": (*table, turns[1])}},
        }
    )


class Room:
    """A furnished room in Bullet: where things truly are, and what cameras make of it."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        self.scene = scene
        self.client = BulletClient()
        self.world = World(self.client, scene, rng)
        name = scene.robot.posture
        self.robot = Krang(self.client, scene.robot.pose, posture(str(name)))

    def truth(self) -> dict[str, Pose]:
        """Return the poses of the frames that tags mark, by name."""
        positions, quaternions = self.robot.link_poses([f"{side}_ft" for side in SIDES])
        grippers = zip(SIDES, positions, quaternions, strict=True)
        poses = {name: self.world.pose(name) for name in self.scene.bodies}
        return poses | {f"{side}_gripper": Pose(place, turn) for side, place, turn in grippers}

    def cameras(self, rng: np.random.Generator) -> TagCameras:
        """Hang cameras that give their pictures as they are."""
        return TagCameras(self.world, tuple(self.scene.bodies), rng)


def run_trial(rng: np.random.Generator) -> Trial:
    """Furnish a room and read its tags in every way."""
    scene = furnished(rng)
    room = Room(scene, rng)
    try:
        truth = room.truth()
        rendered = room.cameras(rng)
        began = time.process_time()
        rendered.capture(0.0, truth)
        taken = time.process_time() - began
        pictures = [each for each in rendered.deliver(LATER) if isinstance(each, CameraPicture)]
        read = tag_reader(tuple(scene.bodies))
        began = time.process_time()
        found = {each.tag: Pose(each.position, each.quaternion) for each in read(pictures)}
        spent = time.process_time() - began
        exact = [
            replace(picture, position=camera.pose.position, quaternion=camera.pose.quaternion)
            for picture, camera in zip(pictures, rendered.cameras, strict=True)
        ]
        ideal = {each.tag: Pose(each.position, each.quaternion) for each in read(exact)}
        noisy = tag_camera(scene, rng)
        noisy.capture(0.0, truth)
        made = {each.name: Pose(each.position, each.quaternion) for each in noisy.deliver(LATER)}
    finally:
        room.client.close()
    ways = zip(WAYS, (found, ideal, made), strict=True)
    return Trial([each for way, got in ways for each in compare(way, got, truth)], taken, spent, len(pictures))


def compare(way: str, got: Mapping[str, Pose], truth: Mapping[str, Pose]) -> list[Reading]:
    """Return the errors of all bodies."""
    out = []
    for name, pose in truth.items():
        kind = "gripper" if name.endswith("_gripper") else "table"
        error, tilt = np.full(4, np.nan), float("nan")
        if name in got:
            turn = Rotation.from_quat(got[name].quaternion) * Rotation.from_quat(pose.quaternion).inv()
            vector = turn.as_rotvec()
            error, tilt = np.array([*(got[name].position - pose.position), vector[2]]), float(np.hypot(*vector[:2]))
        out.append(Reading(way, kind, error, tilt))
    return out


def chosen(trials: list[Trial], way: str, kind: str) -> tuple[Array, Array, float]:
    """Return errors (n, 4) and tilts (n,) of what was read, and the share that was."""
    all_of = [each for trial in trials for each in trial.readings if (each.way, each.kind) == (way, kind)]
    errors = np.array([each.error for each in all_of])
    seen = np.isfinite(errors).all(axis=1)
    return errors[seen], np.array([each.tilt for each in all_of])[seen], float(seen.mean())


def summary(trials: list[Trial]) -> dict[str, dict[str, float]]:
    """Return root mean square and 95 % errors of every way and kind: millimetres and degrees."""
    out = {}
    for way in WAYS:
        for kind in KINDS:
            errors, tilts, share = chosen(trials, way, kind)
            place = 1e3 * np.linalg.norm(errors[:, :3], axis=1)
            flat = 1e3 * np.hypot(errors[:, 0], errors[:, 1])
            yaw, tilt = np.degrees(np.abs(errors[:, 3])), np.degrees(tilts)
            out[f"{kind}, {way}"] = {
                "read": share,
                **{
                    f"{what}_{name}": float(of(values))
                    for what, values in {"xyz_mm": place, "xy_mm": flat, "yaw_deg": yaw, "tilt_deg": tilt}.items()
                    for name, of in {"rms": _rms, "p95": _p95}.items()
                },
            }
    return out


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def _p95(values: Array) -> float:
    return float(np.quantile(values, 0.95)) if len(values) else float("nan")


def rows_of(trials: list[Trial]) -> list[Row]:
    """Return the acceptance rows, and the speed of both sides."""
    table, tilts, share = chosen(trials, "rendered", "table")
    exact = chosen(trials, "pictures alone", "table")[0]
    noise = chosen(trials, "noise", "table")[0]
    hand, _, hands = chosen(trials, "rendered", "gripper")
    wrong = sum(bool(np.linalg.norm(error[:3]) > MISREAD) for error in (*table, *hand))
    frames = sum(trial.pictures for trial in trials)

    def place(errors: Array) -> float:
        return _p95(np.linalg.norm(errors[:, :3], axis=1))

    def yaw(errors: Array) -> float:
        return _p95(np.abs(errors[:, 3]))

    return [
        at_most(
            "a table's place from rendered tags, error in x, y, z together, 95 %",
            place(table),
            "m",
            PLACE,
            rms_m=_rms(np.linalg.norm(table[:, :3], axis=1)),
            calibration_exact_m=place(exact),
            noise_model_m=place(noise),
            tables=len(trials),
        ),
        at_most(
            "a table's yaw from rendered tags, 95 %",
            yaw(table),
            "rad",
            float(YAW),
            rms_rad=_rms(table[:, 3]),
            noise_model_rad=yaw(noise),
            tilt_rad=_p95(tilts),
        ),
        at_most(
            "a gripper's place from rendered tags, error in x, y, z together, 95 %",
            place(hand),
            "m",
            2 * PLACE,
            yaw_rad=yaw(hand),
            read=hands,
        ),
        at_least("tables whose tag was read, share", share, "1", 0.95),
        at_most("readings more than 10 cm off", float(wrong), "1", 0.0),
        at_least(
            "pictures of 1280 x 960 in which tags are found, a second of CPU",
            frames / sum(trial.reading for trial in trials),
            "1/s",
            30.0,
            rendered_a_second=frames / sum(trial.taking for trial in trials),
        ),
    ]


def photograph(rng: np.random.Generator) -> tuple[CameraPicture, dict[str, list[Array]]]:
    """Take whole pictures of a room; return the one with most tags, and their outlines (4, 2) [px] by body."""
    scene = load_scene(SHOWN)
    cameras = scene.sensors.cameras.model_copy(update={"whole": True, "noise": 0.0})
    sensors = scene.sensors.model_copy(update={"cameras": cameras})
    room = Room(scene.model_copy(update={"sensors": sensors}), rng)
    try:
        hung = room.cameras(rng)
        hung.capture(0.0, room.truth())
        pictures = [each for each in hung.deliver(LATER) if isinstance(each, CameraPicture)]
    finally:
        room.client.close()
    sheet = load_tag_sheet(config_file("params", "tags"))
    worn = worn_tags(sheet, tuple(scene.bodies))
    names = {mount.id: name for name, mounts in worn.items() for mount in mounts}
    found = TagReader(sheet.dictionary, worn).find([as_picture(picture) for picture in pictures])
    middle = np.array(pictures[0].image.shape[::-1]) / 2

    def telling(number: int) -> tuple[int, float]:
        """Rank a picture by how many bodies are in it, and how near to its middle."""
        off = [float(np.hypot(*(tag.corners.mean(axis=0) - middle))) for tag in found[number]]
        return len({names[tag.id] for tag in found[number]}), -float(np.mean(off or [0.0]))

    best = max(range(len(pictures)), key=telling)
    shown: dict[str, list[Array]] = {}
    for tag in found[best]:
        shown.setdefault(names[tag.id], []).append(tag.corners)
    return pictures[best], shown


def figure(trials: list[Trial], picture: CameraPicture, found: Mapping[str, list[Array]]) -> Figure:
    """Return a picture with what was found in it, and the errors of both ways."""
    page = Figure(figsize=(11.0, 4.6), layout="constrained")
    left, right = page.subplots(1, 2, width_ratios=(1.5, 1.0))
    left.imshow(picture.image, cmap="gray", vmin=0, vmax=255)
    for number, (name, tags) in enumerate(found.items()):
        color = f"C{number % 10}"
        for corners in tags:
            left.plot(*np.vstack([corners, corners[:1]]).T, color=color, lw=1.5)
            left.plot(*corners[0], "o", ms=3, color=color)
        beside = np.vstack(tags).max(axis=0) * (1, 0) + np.vstack(tags).mean(axis=0) * (0, 1)
        plain = {"boxstyle": "round,pad=0.15", "fc": "white", "ec": "none", "alpha": 0.8}
        offset = (8, (0, 12, -12)[number % 3])
        left.annotate(
            name, beside, offset, textcoords="offset points", va="center", color=color, fontsize=9, bbox=plain
        )
    left.axis("off")
    left.set_title(f"Picture of camera {picture.camera}, tags as found (dot: their upper left corner)", fontsize=9)
    draw_errors(right, trials)
    return page


def draw_errors(axes: Axes, trials: list[Trial]) -> Axes:
    """Draw the errors of a table's place on the floor [mm]."""
    for way, color in (("noise", "0.6"), ("rendered", "#2a6f97")):
        errors = 1e3 * chosen(trials, way, "table")[0]
        label = f"{way}: {_rms(np.hypot(*errors.T[:2])):.1f} mm rms"
        axes.plot(*errors.T[:2], ".", color=color, ms=5, label=label)
    turn = np.linspace(0, 2 * np.pi, 100)
    axes.plot(1e3 * PLACE * np.cos(turn), 1e3 * PLACE * np.sin(turn), color="black", lw=0.8, label="5 mm")
    axes.set_aspect("equal")
    axes.set_xlabel("error in x [mm]")
    axes.set_ylabel("error in y [mm]")
    axes.set_title(f"A table's place in {len(trials)} rooms", fontsize=9)
    axes.legend(fontsize=8, loc="lower right")
    return axes
