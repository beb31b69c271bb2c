"""A table's model is learned from two clean pushes; then it is pushed on and on under the watch, cleanly or not.

What is recorded comes to the watch as it would over topics. An alarm is late by the time since the batch test, done
anew on all that was heard, first gave a p-value below a level: the one that keeps the watch's own promise when the test
is done at every hop, and beside it 5 %, which promises nothing over a stream.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from bullet_sim.errors import SimError
from pbrl_bag.errors import BagError
from pbrl_bag.types import Recording
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, PUSHES, Stage, draw_stage, play
from pbrl_bringup.concealed.streams import clean_pushes, held_seconds, joined
from pbrl_bringup.errors import BringupError
from pbrl_bringup.experiments.kept import keep_run, read_run
from pbrl_mismatch.online.monitor import Alarm, MismatchMonitor
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.significance import batch_p_value, promised_level
from pbrl_mismatch.online.slices import between
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import fit_recording
from pbrl_model.posterior import Posterior

Outcome = TypeVar("Outcome", "Clean", "Late")

CHUNK = 2
"""Pushes of one simulation."""
DELIVERY = 0.25
"""Between two deliveries of what was heard [s]."""
SCAN = 1.0
"""Between two batch tests [s]."""
LOOSE = 0.05
TRIES = 8
"""Draws of an effect before a case counts as one that cannot be made."""


@dataclass(frozen=True)
class Clean:
    """A clean stream: seconds that it was held, alarms, and the largest statistic (logarithm)."""

    seed: int
    seconds: float
    windows: int
    alarms: int
    highest: float


@dataclass(frozen=True)
class Late:
    """An effect's case: when it became significant, at which level, and when the alarm came; None: never [s]."""

    effect: str
    seed: int
    strength: float
    alarm: float | None
    significant: float | None
    significant_at_5_percent: float | None

    @property
    def delay(self) -> float | None:
        """Return how late the alarm was [s]: infinite where it never came; None: there was nothing to see."""
        if self.significant is None:
            return None
        return math.inf if self.alarm is None else self.alarm - self.significant


def clean_stream(seed: int, seconds: float, folder: Path, until: float | None = None) -> Clean | None:
    """Watch a clean stream, or read what was kept of it; None where it is past the time [s] to begin one."""
    told = {"seed": seed, "seconds": seconds}
    return _once(Clean, folder / f"{seed}.json", told, until, lambda: watch_clean(seed, seconds))


def concealed_stream(effect: str, seed: int, folder: Path, until: float | None = None) -> Late | None:
    """Watch a stream with an effect, or read what was kept of it; None where it is past the time [s] to begin one."""
    told = {"effect": effect, "seed": seed}
    return _once(Late, folder / f"{effect}-{seed}.json", told, until, lambda: watch_effect(effect, seed))


def _once(
    kind: type[Outcome], path: Path, told: Mapping[str, Any], until: float | None, watch: Callable[[], Outcome]
) -> Outcome | None:
    kept = read_run(kind, path, told)
    if kept is None and (until is None or time.time() < until):
        kept = watch()
        keep_run(path, told, kept)
    return kept


def watch_clean(seed: int, seconds: float) -> Clean:
    """Learn a table's model, then push it cleanly for so long [s] under the watch."""
    rng = np.random.default_rng([seed, 1])
    stage = draw_stage(rng)
    posterior = learned(clean_pushes(rng, stage, PUSHES))
    parts: list[Recording] = []
    while sum(map(held_seconds, parts)) < seconds:
        parts.append(clean_pushes(rng, stage, CHUNK))
    stream = joined(parts)
    alarms, highest, windows = watched(stream, posterior)
    return Clean(seed, held_seconds(stream), windows, len(alarms), highest)


def watch_effect(effect: str, seed: int) -> Late:
    """Learn a table's model from clean pushes, then push it with an effect concealed under the watch.

    Raises:
        BringupError: no draw of the effect leads to a recording.
    """
    rng = np.random.default_rng([seed, 2, *map(ord, effect)])
    stage = draw_stage(rng)
    posterior = learned(clean_pushes(rng, stage, PUSHES))
    recording, strength = _concealed(rng, stage, effect)
    options = MonitorOptions()
    alarms, _, _ = watched(recording, posterior)
    strict, loose = significant(recording, posterior, (promised_level(options), LOOSE), options)
    return Late(effect, seed, strength, alarms[0][0] if alarms else None, strict, loose)


def _concealed(rng: np.random.Generator, stage: Stage, effect: str) -> tuple[Recording, float]:
    """Return a recording with an effect, and how strong it is."""
    why = ""
    for _ in range(TRIES):
        strength = float(rng.random())
        try:
            concealed = DRAWS[effect](rng, stage, strength)
            made = play(stage, concealed)
        except (SimError, ValueError) as error:
            why = str(error).splitlines()[-1]
            continue
        if made.status == "done":
            return to_recording(made, stage.with_concealed(concealed)), strength
        why = made.status
    raise BringupError(f"{effect}: expected one of {TRIES} draws to be done, got {why} in the last")


def learned(recording: Recording) -> Posterior:
    """Return the model of the table, as `model_node` would publish it."""
    return fit_recording(recording).objects[NAME].posterior


def watched(recording: Recording, posterior: Posterior) -> tuple[list[tuple[float, Alarm]], float, int]:
    """Deliver a recording to the watch piece by piece.

    Returns:
        Every alarm with when it was raised [s], the largest statistic (logarithm), and how many windows were tested.
    """
    monitor = MismatchMonitor()
    monitor.give({NAME: posterior})
    stream = recording.object_poses[NAME].time
    alarms: list[tuple[float, Alarm]] = []
    highest = -math.inf
    for now in np.arange(stream[0] + DELIVERY, stream[-1] + DELIVERY, DELIVERY).tolist():
        alarms += [(now, alarm) for alarm in monitor.hear(between(recording, now - monitor.needed, now))]
        highest = max(highest, monitor.objects[NAME].evidence)
    return alarms, highest, monitor.objects[NAME].tested


def significant(
    recording: Recording, posterior: Posterior, levels: Sequence[float], options: MonitorOptions
) -> list[float | None]:
    """Return when the batch test first gave a p-value below each level [s], None where it never did."""
    found: list[float | None] = [None] * len(levels)
    for now in np.arange(recording.grasps[0].start + 1.5, recording.grasps[-1].end + SCAN, SCAN).tolist():
        try:
            p_value = batch_p_value(recording, posterior, now, options)
        except (BagError, ModelError):  # a hold is not long enough yet
            continue
        found = [now if f is None and p_value < level else f for f, level in zip(found, levels, strict=True)]
        if None not in found:
            break
    return found
