"""From a recording and what was learned of it to what the page shows."""

from __future__ import annotations

import math
import platform
from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from pbrl_bag import BodyGeometry, Recording
from pbrl_bringup.clouds import CLOUD, hinge_of, points_of, poses_of, wheel_of
from pbrl_bringup.replay import Replay
from pbrl_bringup.report_data import (
    Contact,
    Episode,
    HeldOut,
    Hinge,
    Made,
    ObjectReport,
    Parameter,
    Point,
    Report,
    Truth,
    Wheel,
)
from pbrl_bringup.verdict import (
    ahead_verdict,
    circle_verdict,
    free_verdict,
    hinge_verdict,
    learning_verdict,
    spoken,
    wheel_verdict,
)
from pbrl_model.fitting.heldout import Heldout
from pbrl_model.posterior import Posterior
from pbrl_model.priors import table2_prior

Array = NDArray[np.float64]

FRAMES = 15.0  # [Hz] of the pictures; tags come no faster
SHOWN_DRAWS = 20
MEANINGS = {
    "mass": "mass",
    "wheel_x": "held point, in front of the middle",
    "wheel_y": "held point, left of the middle",
    "wheel_theta": "direction in which the wheel points",
    "mu_x": "friction along the wheel, as a share of the weight",
    "mu_y": "friction across the wheel, as a share of the weight",
    "mu_ground": "friction of the other feet, as a share of the weight",
    "hinge_x": "hinge in the room, x",
    "hinge_y": "hinge in the room, y",
    "hinge_radius": "distance from the hinge to the held point",
    "anchor_x": "hinge arm on the body, x",
    "anchor_y": "hinge arm on the body, y",
}
HINGED = {  # what has another meaning where a hinge leads the body
    "mass": "mass, as felt where it was held",
    "mu_x": "friction of the hinge, felt where it was held, as a share of the weight: along x",
    "mu_y": "the same along y",
}


def object_report(
    geometry: BodyGeometry,
    posterior: Posterior,
    replays: Sequence[Replay],
    heldout: Heldout | None,
    rng: np.random.Generator,
    locked: Sequence[Point] | None = None,
) -> ObjectReport:
    """Put together everything about one object.

    Args:
        geometry: known outline and casters.
        posterior: what was learned.
        replays: its pushes, predicted.
        heldout: errors on what the fit did not see.
        rng: chooses the draws that are shown.
        locked: [m] places of the casters that were locked, for a demonstration that shows the truth
            after the fit; None where nobody knows.
    """
    canonical = posterior.canonical()
    starts = sorted({float(replay.time[0]) for replay in replays})
    episodes = [_episode(starts.index(float(replay.time[0])) + 1, replay, rng) for replay in replays]
    draws = _named(canonical)
    wheel = wheel_of(draws, _some(len(draws["mass"]), rng)) if "wheel_x" in draws else None
    hinge = hinge_of(draws, _some(len(draws["mass"]), rng)) if "hinge_x" in draws else None
    return ObjectReport(
        name=geometry.name,
        verdict=_verdict(geometry, canonical),
        detail=_detail(replays, episodes, hinge),
        model_class=canonical.model_class,
        footprint=points_of(geometry.footprint),
        casters=points_of(geometry.casters),
        parameters=_parameters(geometry, canonical, rng),
        notes=list(canonical.notes),
        wheel=wheel,
        hinge=hinge,
        episodes=episodes,
        heldout=None if heldout is None else _heldout(heldout),
        truth=None if locked is None else _truth(wheel, locked),
    )


def whole_report(
    title: str, recording: Recording, objects: Sequence[ObjectReport], command: str, seed: int | None, seconds: float
) -> Report:
    """Put the page together; the first object's verdict is on top."""
    if not objects:
        return Report(
            title=title,
            verdict="Nothing was learned: no object was held and moved in this recording.",
            detail="",
            room=points_of(recording.room),
            objects=[],
            made=_made(recording, command, seed, seconds),
        )
    return Report(
        title=title,
        verdict=objects[0].verdict,
        detail=objects[0].detail,
        room=points_of(recording.room),
        objects=list(objects),
        made=_made(recording, command, seed, seconds),
    )


def _named(posterior: Posterior) -> dict[str, Array]:
    return {name: posterior.column(name).ravel() for name in posterior.names}


def _verdict(geometry: BodyGeometry, posterior: Posterior) -> str:
    draws = _named(posterior)
    name = spoken(geometry.name)
    if posterior.model_class == "hinge":
        return hinge_verdict(name, draws)
    if "wheel_x" in draws:
        return wheel_verdict(name, draws, geometry.footprint, geometry.casters)
    return free_verdict(name, draws)


def _detail(replays: Sequence[Replay], episodes: Sequence[Episode], hinge: Hinge | None) -> str:
    whole = [number for number, each in enumerate(replays) if each.restart is None]
    if not whole:
        return ""
    last = episodes[whole[-1]]
    text = learning_verdict(last.end_before, last.end_after, last.time[-1], fitted=last.fitted)
    if hinge is not None:
        x, y, radius = hinge.mean
        places = np.array([pose[:2] for number in whole for pose in episodes[number].recorded])
        off = np.abs(np.hypot(*(places - [x, y]).T) - radius)
        text = f"{circle_verdict(float(off.max()))} {text}"
    ahead = [each for each in episodes if each.restart is not None]
    return f"{text} {ahead_verdict(ahead[-1].restart, ahead[-1].end_before, ahead[-1].end_after)}" if ahead else text


def _episode(number: int, replay: Replay, rng: np.random.Generator) -> Episode:
    step = max(1, round(1.0 / (FRAMES * float(np.diff(replay.time).mean()))))
    rows = np.unique(np.append(np.arange(0, len(replay.time), step), len(replay.time) - 1))
    after = replay.after[:, rows]
    shown = np.sort(rng.choice(len(after), min(SHOWN_DRAWS, len(after)), replace=False))
    mean = after.mean(axis=0)
    recorded, before = replay.recorded[rows], replay.before[rows]
    return Episode(
        label=_label(number, replay),
        restart=replay.restart,
        end_before=replay.end_error(replay.before),
        end_after=replay.end_error(replay.after.mean(axis=0)),
        time=[round(float(t), 3) for t in replay.time[rows] - replay.time[0]],
        recorded=poses_of(recorded),
        before=poses_of(before),
        after=poses_of(mean),
        draws=[poses_of(after[k]) for k in shown],
        wrench=[(round(float(a), 2), round(float(b), 2), round(float(c), 3)) for a, b, c in replay.wrench[rows]],
        contacts=[
            Contact(gripper=side, point=(float(point[0]), float(point[1])))
            for side, point in sorted(replay.contacts.items())
        ],
        error_before=[float(d) for d in np.hypot(*(before - recorded)[:, :2].T)],
        error_after=[float(d) for d in np.hypot(*(mean - recorded)[:, :2].T)],
        fitted=replay.fitted,
    )


def _label(number: int, replay: Replay) -> str:
    how = "predicted as a whole" if replay.restart is None else f"predicted {replay.restart:g} s at a time"
    return f"push {number}, {how}" + ("" if replay.fitted else ", not fitted")


def _parameters(geometry: BodyGeometry, posterior: Posterior, rng: np.random.Generator) -> list[Parameter]:
    prior = table2_prior(geometry, posterior.model_class)
    ranges = np.quantile(prior.sample(rng, 4000), [0.05, 0.95], axis=0).T
    believed = dict(zip(prior.names, ranges, strict=True))
    meanings = MEANINGS | HINGED if posterior.model_class == "hinge" else MEANINGS
    return [
        Parameter(
            name=name,
            meaning=meanings.get(name, ""),
            mean=float(mean),
            sd=float(sd),
            unit=unit,
            prior=f"{_short(believed[name][0])} to {_short(believed[name][1])}" if name in believed else "",
        )
        for name, mean, sd, unit in zip(posterior.names, posterior.mean(), posterior.sd(), posterior.units, strict=True)
    ]


def _heldout(found: Heldout) -> HeldOut:
    return HeldOut(
        windows=found.count,
        horizon=found.seconds,
        position_before=found.before.final_position,
        position_after=found.after.final_position,
        yaw_before=found.before.final_yaw,
        yaw_after=found.after.final_yaw,
    )


def _truth(wheel: Wheel | None, locked: Sequence[Point]) -> Truth:
    near = min((math.dist(wheel.mean, point) for point in locked), default=None) if wheel else None
    note = "the caster that the simulator had locked; it was asked after the fit, for comparison only"
    return Truth(note=note, locked=[(float(x), float(y)) for x, y in locked], distance=near)


def _made(recording: Recording, command: str, seed: int | None, seconds: float) -> Made:
    return Made(
        command=command,
        recording=str(recording.path),
        seed=seed,
        created=datetime.now().strftime("%Y-%m-%d %H:%M"),
        seconds=seconds,
        versions={
            "pbrl": version("pbrl_bringup"),
            "Python": platform.python_version(),
            "numpy": np.__version__,
        },
    )


def _some(count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    return np.sort(rng.choice(count, min(CLOUD, count), replace=False))


def _short(value: float) -> str:
    return (f"{value:.2g}" if abs(value) < 10 else f"{value:.0f}").replace("-", "−")
