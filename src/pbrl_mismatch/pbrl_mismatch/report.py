"""What was found, in the form of `report.json`, and in sentences."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pbrl_mismatch.activity import activity
from pbrl_mismatch.effects.effect import Effect, Scene, Where
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.moments import moments_of
from pbrl_mismatch.search.fitted import Fitted
from pbrl_mismatch.search.predictive import Verdict, predictive_test
from pbrl_mismatch.search.weigh import NAMED, Weighed, held_by

Array = NDArray[np.float64]

EXPLAINED = 1.35
"""A hypothesis that needs a larger scale of the noise than this has not reached the noise floor."""
NOTHING_TRIED = "nothing that the library was left with can be laid on this body: leave it more (option `without`)"
SHARE_LEFT, NEAR = 0.1, 2.0
"""Unless it leaves less than this share of the baseline's scale, as a logarithm, and needs a scale below this."""
LEFT_OUT = 1e-7
"""Nor has one whose laws are all exact, where the test against wrenches, lasting ones or any, gives it a smaller chance
than this."""
MOST_LEFT, OF_HISTORY, TINY = 0.25, 0.4, 1e-9
"""Nor any that such a test says this of, where it leaves more than this share unexplained of what the baseline does, or
than this of contacts and of what moves besides the body: right laws left 6 % at most, on casters 21 %; a patch in the
place of a drag 37 %, casters in that place, and a load that swings in that of a catch, 50 %."""
FORECASTS = 0.1
"""But for one whose forecast of what was held out is off by less than this share of what the baseline's is: a note then
says that there is more. A crate that goes along beside a wheel left 41 %, and forecast metres to within centimetres;
wrong friction and catches had 31 % at best."""
ALIKE = 3.0
"""Hypotheses within so many nats explain the recording alike."""
SHOWN = 8
OUTLINE = 32
"""Corners of an ellipse."""
LEAST_TOLD = 1e-12
"""Tails further out than this are not told: no noise is known so well."""


@dataclass(frozen=True)
class Finding:
    """One effect of a hypothesis.

    Attributes:
        effect: its name.
        probability: of the hypothesis; of what is named, that it is there, whatever is beside it.
        parameters: mean, sd and unit by name.
        where: frame ("world" or the object's name), outline and the ellipse that holds its middle with 95 % by Laplace;
            or None.
        when: intervals [s], or None.
        direction: the frame in which its force keeps its direction, or what it follows.
        fitted: the hypothesis.
    """

    effect: str
    probability: float
    parameters: Mapping[str, Mapping[str, float | str]]
    where: Mapping[str, Any] | None
    when: list[list[float]] | None
    direction: str | None
    fitted: Fitted

    def to_report(self) -> dict[str, Any]:
        """Return the form of `report.json`."""
        return {
            "effect": self.effect,
            "probability": self.probability,
            "parameters": {name: dict(values) for name, values in self.parameters.items()},
            "where": None if self.where is None else dict(self.where),
            "when": self.when,
            "direction": self.direction,
        }


@dataclass(frozen=True)
class Findings:
    """The named hypothesis, the others, and what must not be read into them.

    Attributes:
        effects: named.
        alternatives: others.
        notes: sentences.
        open: whether what is likeliest would be named, were it probable enough.
    """

    effects: tuple[Finding, ...]
    alternatives: tuple[Finding, ...]
    notes: tuple[str, ...]
    open: bool = False


def findings_of(baseline: Fitted, weighed: tuple[Weighed, ...], scene: Scene, *, exact: bool) -> Findings:
    """Decide what is named; of several effects together, the one that explains more alone comes first.

    Args:
        baseline: fitted.
        weighed: hypotheses, likeliest first; empty where nothing was searched.
        scene: what places are measured in.
        exact: whether the baseline's own laws are; those of a model that is told may not be.
    """
    alone = [each.effects[0] for each in weighed if len(each.effects) == 1]
    others = [_weightiest_first(each, alone) for each in weighed if each.effects]
    if not others:
        return Findings((), (), (NOTHING_TRIED,) if weighed else ())
    best, notes = others[0], []
    names = " and ".join(best.effects)
    short = _falls_short(best, baseline)
    left = _leaves(best, baseline) if exact and not short else ""
    if left and _forecasts(best.fitted, baseline):
        notes.append(f"there is more than {names}: a wrench is left over ({left})")
    elif left:
        short = f"leaves a wrench that its law does not have ({left})"
    sure = held_by(weighed, best.effects)
    sound = bool(weighed[0].effects) and not short and not best.vetoed
    named = sound and sure >= NAMED
    if short:
        notes.append(f"nothing in the library reaches the noise floor: the likeliest, {names}, {short}")
    if best.vetoed:
        notes.append(f"{names} is not named: what was held out of the fit is predicted worse than by the baseline")
    if not bool(best.fitted.peak.settled[0]):
        notes.append(f"the fit of {names} had not settled: its numbers are rough")
    alike = [each for each in others[1:] if each.log_weight > best.log_weight - ALIKE]
    if alike and weighed[0].effects:
        notes.append(f"{' and '.join(' + '.join(e.effects) for e in (best, *alike))} explain this recording alike")
    chosen = _described(replace(best, probability=sure), scene) if named else ()
    rest = others[1:] if named else others
    alternatives = tuple(finding for each in rest[:SHOWN] for finding in _described(each, scene))
    return Findings(chosen, alternatives, tuple(notes), open=sound and not named)


def held_otherwise(p_value: float, of_motion: float, level: float) -> str:
    """Return in words that gripper and body are not seen as one that holds the other.

    Args:
        p_value: of what the grippers' poses say.
        of_motion: of what the motion says.
        level: of a test.
    """
    told = (
        f"gripper and body are not seen as one that holds the other ({_chance(p_value)}), and nothing that is named "
        "makes them so: a tag, the gripper's frame or a camera is off, the hold gives way, or a stream is late"
    )
    return told if of_motion < level else f"{told}; how it moves goes with the model ({_chance(of_motion)})"


def _chance(p_value: float) -> str:
    return f"p = {p_value:.1g}" if p_value >= LEAST_TOLD else f"p < {LEAST_TOLD:g}"


def _falls_short(best: Weighed, baseline: Fitted) -> str:
    """Return in words by what a hypothesis falls short of the noise floor; nothing where it reaches it."""
    scale, before = best.fitted.usual_scale, baseline.usual_scale
    if scale >= EXPLAINED and (scale >= NEAR or math.log(scale) >= SHARE_LEFT * math.log(before)):
        return f"is still off by {scale:.1f} times the noise"
    return ""


def _leaves(best: Weighed, baseline: Fitted) -> str:
    """Return by what chance it is noise that a hypothesis leaves a wrench, in words; nothing where it may be."""
    # Laws of friction and of contacts are a little wrong of any floor: the little that they leave says nothing.
    laws_are_exact = all(EFFECTS[name].exact for name in best.effects)
    share = best.fitted.unexplained / max(baseline.unexplained, TINY)
    most = OF_HISTORY if any(EFFECTS[name].of_history for name in best.effects) else MOST_LEFT
    if not laws_are_exact and share <= most:
        return ""
    left = predictive_test(best.fitted.peak, 0).least
    return _chance(left) if left < LEFT_OUT else ""


def _forecasts(fitted: Fitted, baseline: Fitted) -> bool:
    """Tell whether a hypothesis forecasts what was held out, which the baseline does not at all."""
    if fitted.score is None or baseline.score is None:
        return False
    return fitted.score.rmse_position < FORECASTS * baseline.score.rmse_position


def _weightiest_first(weighed: Weighed, alone: list[str]) -> Weighed:
    """Return a hypothesis with its effects in the order of `alone`: those that were tried alone, likeliest first."""
    order = {name: rank for rank, name in enumerate(alone)}
    return replace(weighed, effects=tuple(sorted(weighed.effects, key=lambda name: order.get(name, len(order)))))


def _described(weighed: Weighed, scene: Scene) -> tuple[Finding, ...]:
    return tuple(_finding(weighed, EFFECTS[name], scene) for name in weighed.effects)


def _finding(weighed: Weighed, effect: Effect, scene: Scene) -> Finding:
    fitted = weighed.fitted
    parameters = parameters_of(fitted, {each.column for each in effect.parameters(scene)})
    values = {name: float(entry["mean"]) for name, entry in parameters.items()}
    where = effect.where(values, scene) if effect.where is not None else None
    track, present = fitted.peak.objective.cuts.track, (*fitted.hypothesis.told, *fitted.hypothesis.effects)
    acts = activity(track, fitted.row, [effect.name], beside=present)[effect.name]
    return Finding(
        effect.name,
        weighed.probability,
        parameters,
        None if where is None else _told(where, track.object, place_uncertainty(fitted, effect, where)),
        None if acts is None else [list(each) for each in acts],
        effect.direction,
        fitted,
    )


def _told(where: Where, name: str, uncertainty: Array | None) -> dict[str, Any]:
    """Return the form of `report.json`; `name` is the object's, and that of its frame."""
    frame = name if where.frame == "body" else where.frame
    told: dict[str, Any] = {"frame": frame, "shape": np.round(where.shape, 4).tolist()}
    return told if uncertainty is None else {**told, "uncertainty": np.round(uncertainty, 4).tolist()}


def place_uncertainty(fitted: Fitted, effect: Effect, where: Where) -> Array | None:
    """Return the ellipse (n, 2) [m] that holds the middle of an effect's place with 95 %, or None if it is not free.

    It is long where a recording shows only a line: that of a wheel which was never pushed along its axle, say.

    Args:
        fitted: with the effect; its draws count, where it has them.
        effect: that has a place.
        where: that place.
    """
    columns = fitted.hypothesis.columns
    if effect.place is None or not set(effect.place) <= set(columns):
        return None
    chosen = [columns.index(column) for column in effect.place]
    covariance = fitted.peak.covariance(0) if fitted.draws is None else np.cov(fitted.draws.T)
    size, axes = np.linalg.eigh(covariance[np.ix_(chosen, chosen)])
    angle = np.linspace(0.0, 2.0 * np.pi, OUTLINE, endpoint=False)
    circle = np.sqrt(chi2.ppf(0.95, 2) * np.maximum(size, 0.0)) * np.stack([np.cos(angle), np.sin(angle)], -1)
    return np.asarray(where.shape.mean(axis=0) + circle @ axes.T, dtype=np.float64)


def parameters_of(fitted: Fitted, columns: set[str] | None = None) -> dict[str, dict[str, Any]]:
    """Return mean, standard deviation and unit of free columns.

    They are those of the draws, where there are any; else of the peak's Gaussian, positive ones by the moments of a
    log-normal.
    """
    if fitted.draws is not None:
        rows = fitted.hypothesis.rows(fitted.draws)
        return {
            each.column: {
                "mean": float(rows[:, COLUMN[each.column]].mean()),
                "sd": float(rows[:, COLUMN[each.column]].std()),
                "unit": each.unit,
            }
            for each in fitted.hypothesis.parameters
            if columns is None or each.column in columns
        }
    covariance = fitted.peak.covariance(0)
    out = {}
    for k, parameter in enumerate(fitted.hypothesis.parameters):
        if columns is not None and parameter.column not in columns:
            continue
        value, variance = float(fitted.peak.coordinates[0, k]), float(covariance[k, k])
        mean, sd = moments_of(value, variance, parameter.positive)
        out[parameter.column] = {"mean": mean, "sd": sd, "unit": parameter.unit}
    return out


def held_out_report(baseline: Fitted, repaired: Fitted, floor: tuple[float, float]) -> dict[str, Any]:
    """Return errors on what was held out before and after the repair, with the poses' noise beside them.

    Errors are those of forecasts (`search.heldout.Score`); `rmse_position_retold_m` is what is left where the start of
    each window and a steady wrench are fitted to it.
    """
    before, after = baseline.score, repaired.score

    def entry(first: float | None, second: float | None, least: float) -> dict[str, float | None]:
        return {"baseline": _number(first), "repaired": _number(second), "noise_floor": _number(least)}

    return {
        "rmse_position_m": entry(
            before.rmse_position if before else None, after.rmse_position if after else None, floor[0]
        ),
        "rmse_yaw_rad": entry(before.rmse_yaw if before else None, after.rmse_yaw if after else None, floor[1]),
        "rmse_position_retold_m": entry(
            before.rmse_retold if before else None, after.rmse_retold if after else None, floor[0]
        ),
        "log_score": {
            "baseline": _number(before.log_score if before else None),
            "repaired": _number(after.log_score if after else None),
        },
    }


def _number(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def sentence(name: str, mismatch: bool, verdict: Verdict, found: Findings) -> str:
    """Return the verdict in one sentence."""
    if not mismatch:
        return f"{name}: model and recording agree (p = {verdict.p_value:.2g})"
    chance = _chance(verdict.p_value)
    if not found.effects:
        what = "which of what may explain it is open" if found.open else "it is none of what the library knows"
        return f"{name}: something is left out ({chance}), and {what}"
    what = " and ".join(finding.effect for finding in found.effects)
    left = "is" if len(found.effects) == 1 else "are"
    return f"{name}: {what} {left} left out ({100 * found.effects[0].probability:.0f} %, {chance})"
