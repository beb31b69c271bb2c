"""The description of a mismatch that no effect explains, in sentences and as a report."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from pbrl_mismatch.activity import Interval, intervals
from pbrl_mismatch.data.residual import ResidualWrench, residual_wrench
from pbrl_mismatch.data.track import Track
from pbrl_mismatch.unknown.features import features_of
from pbrl_mismatch.unknown.process import WrenchProcess, wrench_process
from pbrl_mismatch.unknown.regression import FLOOR, SparseLaw, Term, refined, sparse_law
from pbrl_mismatch.unknown.samples import Samples, apart, samples_of

Array = NDArray[np.float64]

STABLE = 0.5
"""A term that is chosen from fewer random halves of the recording is told with a warning."""
PREDICTS = 0.2
"""A process that predicts less than this share of the wrench says nothing of where it is."""
SURE = math.sqrt(float(chi2.ppf(0.95, 3)) / 3.0)
"""What noise alone reaches at one moment of twenty, as `ResidualWrench.significance` counts."""
COVERS = 0.5
"""Quantile of the distance between moments; a length above it means that the wrench hardly depends on it."""


@dataclass(frozen=True)
class UnknownDescription:
    """What a wrench that no effect explains is like.

    Attributes:
        law: a combination of few physical features.
        process: over place, heading and velocity.
        when: (start, end) in which it is surely there [s].
        sentences: the same for people, the most important first.
        notes: what must not be read into it.
    """

    law: SparseLaw
    process: WrenchProcess
    when: tuple[Interval, ...]
    sentences: tuple[str, ...]
    notes: tuple[str, ...]

    def to_report(self) -> dict[str, Any]:
        """Return a JSON-able form."""
        return {
            "sentences": list(self.sentences),
            "terms": [_term_report(term) for term in self.law.terms],
            "share_explained": self.law.share,
            "left_over": {"value": self.law.left_over, "unit": "N"},
            "gaussian_process": self.process.to_report(),
            "when": [list(each) for each in self.when],
            "notes": list(self.notes),
        }


def describe_unknown(
    rng: np.random.Generator, track: Track, residual: ResidualWrench, row: Array, *, floor: float = FLOOR
) -> UnknownDescription:
    """Describe the wrench that a model lacks.

    Args:
        rng: draws halves of the recording.
        track: what was recorded.
        residual: under the model, with the memory that is likeliest.
        row: (WIDTH,) of the model.
        floor: size of the wrist sensor's own error [N].

    Raises:
        MismatchError: the recording is too short.
    """
    when = surely_there(track, residual, floor)
    followed = residual_wrench(track, row)  # a law is told by how it changes: the wrench is followed wherever it goes
    rows = apart(track)
    every = samples_of(track, followed)
    moments, features = every.take(rows), features_of(every)
    law = sparse_law(rng, moments, [feature.take(rows) for feature in features], floor)
    law = refined(track, row, followed, law, features, rows, floor)
    process = wrench_process(moments)
    sentences = [*(_term_sentence(term) for term in law.terms), *_placed(process, moments)]
    if not sentences:
        sentences = [f"a wrench of about {_size(moments):.1f} N without a law that could be told"]
    if when:
        held, there = len(track.clock) * track.dt, sum(end - start for start, end in when)
        sentences.append(f"it is surely there for {there:.0f} s of the {held:.0f} s in which the object was held")
    return UnknownDescription(law, process, when, tuple(sentences), tuple(_notes(law, process)))


def surely_there(track: Track, residual: ResidualWrench, floor: float = FLOOR) -> tuple[Interval, ...]:
    """Return when a left-out wrench is told from none with 95 %, as intervals (start, end) [s] in order.

    Where it is not, it may be there still, and too small to be told.

    Args:
        track: what was recorded.
        residual: under a model.
        floor: size of the wrist sensor's own error [N].
    """
    size = np.linalg.norm(residual.world / [1.0, 1.0, track.gyration], axis=1)
    return intervals(track, (residual.significance > SURE) & (size > floor))


def _size(moments: Samples) -> float:
    return float(np.sqrt(np.mean(np.sum(moments.wrench[:, :2] ** 2, axis=1))))


def _term_report(term: Term) -> dict[str, Any]:
    return {
        "feature": term.feature.name,
        "frame": term.feature.frame,
        "unit": term.feature.unit,
        "coefficients": {
            name: {"mean": float(mean), "sd": float(sd)}
            for name, mean, sd in zip(term.feature.parts, term.mean, term.sd, strict=True)
        },
        "stability": term.stability,
        "share": term.share,
    }


def _term_sentence(term: Term) -> str:
    """Return one term as a person would say it."""
    feature, says = term.feature, term.feature.says
    unit = "" if feature.unit == "1" else f" {feature.unit}"
    turns = feature.unit.startswith("N m") or feature.unit == "kg m^2"
    what = "moment" if turns else "force"
    if feature.name.startswith("rhythm"):
        size = float(np.hypot(*_pair(term.mean)))
        return f"a force of {size:.2g} ± {np.sqrt(np.mean(term.sd**2)):.1g}{unit} {says}"
    if len(term.mean) == 2:
        angle = math.degrees(math.atan2(term.mean[1], term.mean[0]))
        side = "left" if angle >= 0.0 else "right"
        whose = {
            "world": f"towards {angle:.0f} degrees from the world's x axis",
            "body": f"{abs(angle):.0f} degrees to the {side} of straight ahead",
        }[feature.frame]
        amount = f"{np.hypot(*term.mean):.2g} ± {np.sqrt(np.mean(term.sd**2)):.1g}{unit}"
        return f"a {what} of {amount} {says}, {whose}"
    amount = f"{abs(term.mean[0]):.3g} ± {term.sd[0]:.1g}{unit}"
    if feature.unit not in ("N", "N m"):
        felt = float(np.sqrt(np.mean(np.sum((feature.values[..., 0] * term.mean[0]) ** 2, axis=1))))
        amount += f" (about {felt:.2g} {'N m' if turns else 'N'} here)"
    return f"a {what} of {amount} {says}" if term.mean[0] >= 0.0 else f"a {what} that is {amount} less {says}"


def _pair(mean: Array) -> tuple[float, float]:
    """Return the two numbers whose length is the size of a term: halves of a rhythm's four."""
    half = max(1, len(mean) // 2)
    return float(np.linalg.norm(mean[:half])), float(np.linalg.norm(mean[half:]))


def _placed(process: WrenchProcess, moments: Samples) -> list[str]:
    """Say where the process has the wrench largest, and what it depends on."""
    if process.share < PREDICTS:
        return []
    mean, covariance = process.predict(moments.place, moments.heading, moments.velocity)
    size = np.hypot(mean[:, 0], mean[:, 1])
    top = int(np.argmax(size))
    along = mean[top, :2] / max(float(size[top]), 1e-12)
    sd = math.sqrt(max(float(along @ covariance[top, :2, :2] @ along), 0.0))
    apart_by = [_typical(values) for values in (moments.place, _circle(moments.heading), moments.velocity)]
    names = [
        name
        for name, length, typical in zip(("place", "heading", "velocity"), process.lengths, apart_by, strict=True)
        if length < 2.0 * typical
    ]
    on = f"depends on {', '.join(names)}" if names else "is much the same everywhere"
    return [
        f"{100.0 * process.share:.0f} % of it can be predicted from place, heading and velocity: it {on}, and is "
        f"largest near ({moments.place[top, 0]:.2f}, {moments.place[top, 1]:.2f}) m, {size[top]:.1f} ± {sd:.1f} N"
    ]


def _circle(heading: Array) -> Array:
    return np.stack([np.cos(heading), np.sin(heading)], -1)


def _typical(values: Array) -> float:
    """Return how far moments (n, 2) are apart as a rule."""
    away = values[:, None] - values[None]
    return float(np.quantile(np.hypot(away[..., 0], away[..., 1]), COVERS))


def _notes(law: SparseLaw, process: WrenchProcess) -> list[str]:
    notes = []
    if not law.terms:
        notes.append("no physical feature is worth naming: what is left out is no simple law, or next to the noise")
    shaky = [term.feature.name for term in law.terms if term.stability < STABLE]
    if shaky:
        notes.append(f"half of the recording alone would not always show: {', '.join(shaky)}")
    if law.terms and law.share < 0.5:
        notes.append(f"the named terms explain {100.0 * law.share:.0f} % of the wrench; most of it stays unexplained")
    if not process.settled:
        notes.append("the search for the process's lengths had not settled: they are rough")
    if process.share < PREDICTS:
        notes.append("place, heading and velocity do not predict the wrench: it has a memory, or follows time")
    return notes
