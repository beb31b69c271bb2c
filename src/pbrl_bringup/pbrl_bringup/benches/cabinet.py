"""A real PR2 pulls real doors open: hinge and path, and what constant friction on that hinge leaves out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bag import Recording, read_recording
from pbrl_bringup.benches.cabinet_catch import catch_of, false_alarms
from pbrl_bringup.benches.rows import Measured, at_most, within
from pbrl_bringup.diagnosis.door_figures import side_by_side
from pbrl_bringup.errors import BringupError
from pbrl_bringup.paths import config_file, workspace
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.fit import FitOptions, ObjectFit, fit_recording
from pbrl_model.predict import predict, unlearned

Array = NDArray[np.float64]

RECORDING = "pr2_cabinet/ikea_cabinet.csv"
CATCHES = {"lab cabinet": "pr2_cabinet/lab_cabinet.csv", "IKEA cabinet": RECORDING}
RADIUS, SLACK = 0.300, 0.015  # [m]
FIRST_PART = 0.6  # of a pull, to learn from where the rest is to be predicted


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Fit the hinge of the IKEA cabinet, then say what both cabinets have that constant friction on a hinge has not."""
    hinge = _hinge(seed)
    mapping = config_file("mappings", "pr2_cabinet")
    found = [catch_of(label, read_recording(data_file(name), mapping), seed, quick) for label, name in CATCHES.items()]
    doors = {label: each.door for label, each in zip(CATCHES, found, strict=True) if each.door is not None}
    side_by_side(doors).savefig(out / "doors.png", dpi=110)
    found.append(false_alarms(seed, quick))
    rows = [row for each in found for row in each.rows]
    details = {name: part for each in found for name, part in each.details.items()}
    return Measured([*hinge.rows, *rows], {**hinge.details, **details})


def _hinge(seed: int) -> Measured:
    """Fit the hinge of the IKEA cabinet and compare with its radius and with the handle's recorded path."""
    recording = read_recording(data_file(RECORDING), config_file("mappings", "pr2_cabinet"))
    options = FitOptions(model_class="hinge", seed=seed)
    fit = fit_recording(recording, options)
    name, found = next(iter(fit.objects.items()))
    radius = found.posterior.column("hinge_radius").ravel()
    recorded = np.vstack([motion.pose[:, :2] for motion in found.motions])
    deviation = path_deviation(found, recorded)
    line = straight_line_deviation(recorded)
    unlearned_row = unlearned(recording.bodies[name]).to_vector()[None]
    motion = found.motions[-1]
    ends = [predict(motion, rows, found.body).mean[-1, :2] for rows in (unlearned_row, found.posterior.rows())]
    missed = [float(np.hypot(*(end - motion.pose[-1, :2]))) for end in ends]
    return Measured(
        [
            within(
                "IKEA cabinet: radius of the hinge, posterior mean",
                radius.mean(),
                "m",
                RADIUS,
                SLACK,
                sd=float(radius.std()),
            ),
            at_most(
                "IKEA cabinet: handle's recorded path, worst distance from the learned hinge's circle",
                float(deviation.max()),
                "m",
                0.01,
                straight_line_m=float(line.max()),
                mean_m=float(deviation.mean()),
                rest_from_first_60_percent_m=rest_after(recording, options),
            ),
        ],
        {
            "fit": fit.to_report(),
            "seconds_of_fit": fit.seconds,
            "open_loop_end_error_m": {"before": missed[0], "after": missed[1]},
        },
    )


def rest_after(recording: Recording, options: FitOptions, share: float = FIRST_PART) -> float:
    """Learn from the first share of every pull's time; return how far the rest is from that hinge's circle, worst [m].

    A handle is not quite on a circle (the gripper gives way on it), so a short arc says little of its hinge.
    """
    first = replace(
        recording,
        grasps=tuple(replace(grasp, end=grasp.start + share * (grasp.end - grasp.start)) for grasp in recording.grasps),
    )
    name, found = next(iter(fit_recording(first, options).objects.items()))
    unseen = [
        motion.pose[motion.pose_time > seen.time[-1], :2]
        for motion, seen in zip(motions_of(recording, name, options), found.motions, strict=True)
    ]
    return float(path_deviation(found, np.vstack(unseen)).max())


def path_deviation(found: ObjectFit, recorded: Array) -> Array:
    """Return how far each recorded place (n, 2) is from the circle that the mean hinge lets the handle move on [m]."""
    centre = np.array([found.posterior.column(name).mean() for name in ("hinge_x", "hinge_y")])
    radius = float(found.posterior.column("hinge_radius").mean())
    return np.abs(np.hypot(*(recorded - centre).T) - radius)


def straight_line_deviation(recorded: Array) -> Array:
    """Return how far each place (n, 2) is from the best straight line: what a drawer would leave [m]."""
    centred = recorded - recorded.mean(axis=0)
    across = np.linalg.svd(centred, full_matrices=False)[2][1]
    return np.abs(centred @ across)


def data_file(name: str) -> Path:
    """Return a recording that comes with the workspace's tests.

    Raises:
        BringupError: it is not there.
    """
    path = workspace() / "test/data" / name
    if not path.is_file():
        raise BringupError(
            f"expected the recording {path}, found none; run the bench in a whole clone of the workspace"
        )
    return path
