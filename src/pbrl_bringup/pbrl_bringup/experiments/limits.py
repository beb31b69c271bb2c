"""What a diagnosis cannot tell, each limit measured on a recording that shows it.

Every case is drawn and simulated like those of the bench on concealed things, and fitted by an oracle that is told what
was concealed: what is left open then is the recording's doing, and no search would settle it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import Recording
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.concealed.cases import Case, Made, make
from pbrl_bringup.concealed.oracle import Oracle, lay_out
from pbrl_bringup.concealed.stage import NAME
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.limits_figure import Drawn, Friction, Ridge, draw
from pbrl_bringup.parallel import in_parallel
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.diagnose import fit_baselines
from pbrl_mismatch.effects.effect import disc
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_mismatch.report import place_uncertainty
from pbrl_mismatch.search.explain import explain
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.heldout import settle
from pbrl_mismatch.search.objective import Objective

Array = NDArray[np.float64]

EFFECTS_SHOWN = (
    "second_wheel",
    "wrench_frame",
    "floor_slope",
    "pose_bias",
    "viscous_drag",
    "breakaway_friction",
)
TRIES, STEP = 8, 50
"""Seeds that are tried for one recording, and how far they are apart."""
LENGTHS = (0.5, 1.0, 1.5, 2.0, 3.0, 4.0)
"""Of windows that are predicted [s]."""
DRAWS = 400
FAST = 0.05
"""A push faster than this [m/s] hardly shows what holds at rest."""


@dataclass(frozen=True)
class Shown:
    """One recording with what an oracle and a diagnosis of few effects make of it."""

    effect: str
    made: Made
    oracle: Oracle
    evidence: dict[str, float]
    ungripped: dict[str, float]


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Simulate a recording for each limit, in parallel processes; draw what each leaves open.

    Args:
        seed: of the recordings.
        quick: nothing is left out: it takes about a minute.
        out: folder for the figure.
    """
    shown = {each.effect: each for each in in_parallel(show, [(name, seed) for name in EFFECTS_SHOWN], "recordings")}
    wheel, scale = shown["second_wheel"], shown["wrench_frame"]
    place = ridge(wheel.oracle.fitted, ("wheel2_x", "wheel2_y"), wheel.made.truth.told, seed)
    weighed = {"mass": scale.made.recording.bodies[NAME].nominal_mass}
    mass = ridge(scale.oracle.fitted, ("mass", "force_scale"), scale.made.truth.told | weighed, seed)
    odds = {
        "floor slope, or a steady push": _against(shown["floor_slope"].evidence, "floor_slope", "external_force"),
        "tag off, or mass off\n(no gripper seen)": _against(shown["pose_bias"].ungripped, "pose_bias", "com_offset"),
        "tag off, or mass off\n(grippers seen)": _against(shown["pose_bias"].evidence, "pose_bias", "com_offset"),
    }
    scales = {name: predicted(shown[name].oracle.fitted) for name in ("viscous_drag", "breakaway_friction")}
    friction = friction_of(shown["breakaway_friction"].oracle.fitted)
    outline = wheel.made.recording.bodies[NAME].footprint
    x, y = (float(wheel.oracle.fitted.row[COLUMN[column]]) for column in ("wheel2_x", "wheel2_y"))
    ellipse = place_uncertainty(wheel.oracle.fitted, EFFECTS["second_wheel"], disc("body", x, y, 0.05))
    draw(Drawn(place, outline, ellipse, mass, odds, LENGTHS, scales, friction), out)
    return Measured(rows_of(place, mass, odds, scales, friction), {"odds": odds, "scales": scales})


def show(effect: str, seed: int) -> Shown:
    """Simulate a recording in which an effect is concealed, and say what may have been.

    Args:
        effect: its name.
        seed: of the first draw that is tried.

    Raises:
        BringupError: none of the draws can be made.
    """
    why = ""
    for number in range(TRIES):
        try:
            made = make(Case((effect,), seed + STEP * number))
        except BringupError as error:
            why = str(error)
            continue
        if made.oracle is not None:
            rivals = {"floor_slope": "external_force", "pose_bias": "com_offset"}
            pair = (effect, rivals[effect]) if effect in rivals else ()
            seen = evidence_of(made.recording, pair, gripped=True) if pair else {}
            unseen = evidence_of(made.recording, pair, gripped=False) if effect == "pose_bias" else {}
            return Shown(effect, made, made.oracle, seen, unseen)
    raise BringupError(f"limits: expected one of {TRIES} draws of {effect} to be made, got {why!r} in the last")


def evidence_of(recording: Recording, effects: tuple[str, ...], *, gripped: bool) -> dict[str, float]:
    """Return the log evidence of each of a few effects over the baseline's, with or without the grippers' poses [nat].

    Args:
        recording: of a table.
        effects: that are tried.
        gripped: whether what the grippers' poses say beside the motion counts.
    """
    laid = lay_out(recording, NAME)
    options = DiagnoseOptions(without=tuple(name for name in EFFECTS if name not in effects), most_together=1)
    bases = fit_baselines(np.random.default_rng(0), laid.track, laid.stages, options)
    grip = laid.grip if gripped else None
    found = explain(np.random.SeedSequence(0), laid.track, bases, laid.stages, grip, options)
    none = max(base.evidence for base in found.bases)
    return {each.effects[0]: each.fitted.evidence - none for each in found.weighed if each.effects}


def ridge(fitted: Fitted, columns: tuple[str, str], told: dict[str, float], seed: int) -> Ridge:
    """Return draws of two parameters from a fit's posterior, and what is true of them.

    Args:
        fitted: told oracle's.
        columns: of the two.
        told: the truth by column; one that is not there is not known.
        seed: of the draws.
    """
    hypothesis = fitted.hypothesis
    rng = np.random.default_rng(seed)
    covariance = fitted.peak.covariance(0)
    draws = hypothesis.believable(rng.multivariate_normal(fitted.peak.coordinates[0], covariance, DRAWS))
    rows = hypothesis.rows(draws)[:, [COLUMN[column] for column in columns]]
    chosen = [hypothesis.columns.index(column) for column in columns]
    both = covariance[np.ix_(chosen, chosen)]
    size = np.sqrt(np.linalg.eigvalsh(both))
    correlation = float(both[0, 1] / math.sqrt(both[0, 0] * both[1, 1]))
    truth = (told.get(columns[0], math.nan), told.get(columns[1], math.nan))
    return Ridge(columns, rows, truth, correlation, (float(size[1]), float(size[0])))


def predicted(fitted: Fitted) -> list[float]:
    """Return the scale of the noise that a told law needs over windows of `LENGTHS`."""
    found = []
    for length in LENGTHS:
        cuts = cut_windows(fitted.peak.objective.cuts.track, length)
        objective = Objective(fitted.hypothesis, cuts, fitted.peak.objective.floor)
        z = settle(objective, fitted.peak.coordinates)
        misfit = objective.misfit(objective.residual(fitted.peak.coordinates, z), z)
        found.append(float(np.sqrt(misfit.sum() / objective.observations)))
    return found


def friction_of(fitted: Fitted) -> Friction:
    """Return friction against speed of feet that stick, that of the plain law beside it, and the speeds of the push."""
    row = fitted.row
    speed = np.linspace(0.0, 0.15, 200)
    excess = row[COLUMN["breakaway_mu"]] * np.exp(-((speed / row[COLUMN["breakaway_speed"]]) ** 2))
    seen = np.hypot(*fitted.peak.objective.cuts.track.seen[:, 3:5].T)
    sliding = float(row[COLUMN["slide_mu"]])
    return Friction(speed, sliding + excess, np.full_like(speed, sliding), seen)


def _against(evidence: dict[str, float], one: str, other: str) -> float:
    return evidence.get(one, math.nan) - evidence.get(other, math.nan)


def rows_of(
    place: Ridge, mass: Ridge, odds: dict[str, float], scales: dict[str, list[float]], friction: Friction
) -> list[Row]:
    """Return what each limit comes to."""
    slope, free, gripped = odds.values()
    longest = LENGTHS.index(2.0)
    fast = friction.speed > FAST
    apart = np.abs(friction.sticking - friction.plain)[fast] / friction.plain[fast]
    long, short = (100.0 * size for size in place.size)
    return [
        at_least("second wheel: spread of its place one way over the other", long / short, "x", 2.0, cm=f"{long:.1f}"),
        at_least("force scale and mass: size of their correlation", abs(mass.correlation), "1", 0.8),
        at_most("floor slope or steady push: odds, in nats", abs(slope), "nat", 5.0),
        at_most("tag or centre of mass off, no gripper seen: odds, in nats", abs(free), "nat", 10.0),
        at_least("the same with the grippers seen", gripped, "nat", 10.0),
        at_most("sticking or plain friction above 5 cm/s: how far apart", float(apart.max()), "1", 0.1),
        at_least(
            "predicting 2 s where feet stick over where they slide: scale of the noise",
            scales["breakaway_friction"][longest] / scales["viscous_drag"][longest],
            "x",
            1.05,
        ),
    ]
