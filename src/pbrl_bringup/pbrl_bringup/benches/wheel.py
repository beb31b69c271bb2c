"""Tables with a locked caster: whether it is found, and whether another push of the same table is predicted."""

from __future__ import annotations

import shutil
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bullet_sim.catalogue import OfficeTable
from bullet_sim.scene import Scene, load_scene
from krang_sim.session import KrangSession
from pbrl_bag import read_recording
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.simulate import simulate_push
from pbrl_control.push_plan import PushPlan, Segment, load_plan
from pbrl_model.fitting.episodes import motions_of
from pbrl_model.fitting.fit import FitOptions, ObjectFit, fit_recording
from pbrl_model.predict import path_error, predict_windows, unlearned
from pbrl_model.sensing.windows import whole_windows

Array = NDArray[np.float64]

SEEDS, QUICK_SEEDS = 10, 2
NEAR = 0.05  # [m] the wheel counts as found
SHARE = 0.2  # of the unlearned model's error
SCENE, PLAN = "locked_caster", "turn_table"


@dataclass(frozen=True)
class Trial:
    """One seed.

    Attributes:
        seed: of simulation and fit.
        distance: from the posterior mean of the wheel to the locked caster's axis [m].
        contact: from there to where the locked caster's wheel touches the floor, up to its trail off the axis [m].
        position_before: error of the held-out push's final position without learning [m].
        position_after: the same, learned.
        yaw_before: error of its final heading [rad].
        yaw_after: the same, learned.
        seconds: of the fit.
    """

    seed: int
    distance: float
    contact: float
    position_before: float
    position_after: float
    yaw_before: float
    yaw_after: float
    seconds: float


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Simulate, fit and predict for consecutive seeds, in parallel processes."""
    seeds = range(seed, seed + (QUICK_SEEDS if quick else SEEDS))
    trials = in_parallel(run_trial, [(number, out) for number in seeds], "seeds")
    return Measured(rows_of(trials), {"trials": [asdict(trial) for trial in trials]})


def rows_of(trials: list[Trial]) -> list[Row]:
    """Return the acceptance rows over all seeds."""
    found = sum(trial.distance <= NEAR for trial in trials)
    position = _ratio([trial.position_after for trial in trials], [trial.position_before for trial in trials])
    yaw = _ratio([trial.yaw_after for trial in trials], [trial.yaw_before for trial in trials])
    return [
        at_least(
            f"seeds whose wheel is within 5 cm of the locked caster, of {len(trials)}",
            found,
            "1",
            int(np.ceil(0.9 * len(trials))),
            worst_m=max(trial.distance for trial in trials),
            median_m=float(np.median([trial.distance for trial in trials])),
            worst_to_contact_m=max(trial.contact for trial in trials),
            median_to_contact_m=float(np.median([trial.contact for trial in trials])),
        ),
        at_most(
            "held-out push: final position error over the unlearned model's",
            position,
            "1",
            SHARE,
            unlearned_m=_rms([trial.position_before for trial in trials]),
            learned_m=_rms([trial.position_after for trial in trials]),
        ),
        at_most(
            "held-out push: final heading error over the unlearned model's",
            yaw,
            "1",
            SHARE,
            unlearned_rad=_rms([trial.yaw_before for trial in trials]),
            learned_rad=_rms([trial.yaw_after for trial in trials]),
        ),
    ]


def run_trial(seed: int, out: Path) -> Trial:
    """Simulate two pushes of one table, learn from the first, predict the second."""
    scene, plan = load_scene(SCENE), load_plan(PLAN)
    learned_from = _recorded(scene, plan, seed, out / f"learn_{seed}")
    # Another run of the same table: its casters stand otherwise, and the push is another.
    predicted_in = _recorded(scene, other_profile(plan), 1000 + seed, out / f"heldout_{seed}")
    fit = fit_recording(read_recording(learned_from), FitOptions(seed=seed, holdout_share=0.0))
    found = fit.objects[plan.object]
    errors = heldout_errors(found, predicted_in)
    distance = distance_to_locked(scene, found)
    contact = float(np.hypot(*(locked_contacts(scene, plan.object, seed) - wheel_of(found)).T).min())
    return Trial(seed, distance, contact, *errors, fit.seconds)


def other_profile(plan: PushPlan) -> PushPlan:
    """Return the same plan with another contact point and another profile of speeds."""
    grip = plan.grips[0]
    held = grip.model_copy(update={"point": (grip.point[0], grip.point[1] - 0.12)})
    segments = (
        Segment(twist=(0.14, 0.0, 0.0), duration=3.2),
        Segment(twist=(0.0, 0.0, 0.0), duration=0.8),
        Segment(twist=(0.22, 0.0, 0.0), duration=1.8),
    )
    return plan.model_copy(update={"name": f"{plan.name}_other", "grips": (held,), "segments": segments})


def _recorded(scene: Scene, plan: PushPlan, seed: int, bag: Path) -> Path:
    shutil.rmtree(bag, ignore_errors=True)
    made = simulate_push(scene, plan, seed, bag)
    if made.phase != "done":
        raise BringupError(f"seed {seed}: expected the push {plan.name} to be done, it failed: {made.status}")
    return bag


def distance_to_locked(scene: Scene, found: ObjectFit) -> float:
    """Return the distance [m] from the posterior mean of the wheel to the nearest locked caster; scoring only."""
    name = found.posterior.object
    table = scene.bodies[name]
    if not isinstance(table, OfficeTable):
        raise BringupError(f"{name}: expected an office table, got {type(table).__name__}")
    places = np.array([table.swivels[caster] for caster in scene.concealed.locked_casters[name]])
    return float(np.hypot(*(places - wheel_of(found)).T).min())


def wheel_of(found: ObjectFit) -> Array:
    """Return the posterior mean of the wheel's place (2,) [m] in the body's frame."""
    canonical = found.posterior.canonical()
    return np.array([canonical.column(column).mean() for column in ("wheel_x", "wheel_y")])


def locked_contacts(scene: Scene, name: str, seed: int) -> Array:
    """Return where a table's locked casters touch the floor (k, 2) [m] in its frame; scoring only.

    A locked caster keeps the angle at which it was left, which the world's seed draws: the world of the
    session that was recorded is built once more.
    """
    with KrangSession(scene, seed=seed) as session:
        table = session.world.find(name)
        if table.casters is None:
            raise BringupError(f"{name}: expected a body on casters, got one without")
        pose = table.pose()
        touching = [pose.inverse_point(point)[:2] for point in table.casters.contacts()]
        locked = [caster.locked for caster in table.casters.links]
    return np.array(touching)[locked]


def heldout_errors(found: ObjectFit, bag: Path) -> tuple[float, float, float, float]:
    """Return the final position [m] and heading [rad] errors of a whole push: before, after, before, after."""
    recording = read_recording(bag)
    name = found.posterior.object
    windows = whole_windows(motions_of(recording, name))
    before, after = (
        path_error(windows, predict_windows(windows, rows, found.body))
        for rows in (unlearned(recording.bodies[name]).to_vector()[None], found.posterior.rows())
    )
    return before.final_position, after.final_position, before.final_yaw, after.final_yaw


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def _ratio(after: list[float], before: list[float]) -> float:
    return _rms(after) / _rms(before)
