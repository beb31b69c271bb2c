"""The watch over a stream: no alarm while a table is pushed cleanly for half an hour, and how late it is if not.

A table's model is learned from two clean pushes. Then it is pushed on and on, with nothing concealed, or pushed with
an effect concealed; what is recorded comes to the watch as it would over topics. An alarm is late by the time since
the batch test, done anew on all that was heard, first gave a p-value below a level: the one that keeps the watch's own
promise when the test is done at every hop, and beside it 5 %, which promises nothing over a stream.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from bullet_sim.errors import SimError
from pbrl_bag.errors import BagError
from pbrl_bag.types import Recording
from pbrl_bringup.benches.concealed_rows import interval
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, PUSHES, Stage, draw_stage, play
from pbrl_bringup.concealed.streams import clean_pushes, held_seconds, joined
from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import in_parallel
from pbrl_mismatch.online.monitor import Alarm, MismatchMonitor
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.significance import batch_p_value, promised_level
from pbrl_mismatch.online.slices import between
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import fit_recording
from pbrl_model.posterior import Posterior

FIRST_SEED = 10_000
"""Scored seeds begin here; those below are for development."""
STREAMS, QUICK_STREAMS = 2, 1
"""Tables that are pushed cleanly."""
SECONDS, QUICK_SECONDS = 1800.0, 100.0
"""For which each of them is held."""
CHUNK = 2
"""Pushes of one simulation."""
SEEDS = 2
"""Cases of each effect."""
QUICK_EFFECTS = ("external_force", "floor_patch")
DELIVERY = 0.25
"""Between two deliveries of what was heard [s]."""
SCAN = 1.0
"""Between two batch tests [s]."""
LOOSE = 0.05
IN_TIME = 2.0
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
    """An effect's case: when it became significant, at which level, and when the alarm came; NaN: never [s]."""

    effect: str
    seed: int
    strength: float
    alarm: float
    significant: float
    significant_at_5_percent: float

    @property
    def delay(self) -> float:
        """Return how late the alarm was [s]; negative where it came first, infinite where it never came."""
        return math.inf if math.isnan(self.alarm) else self.alarm - self.significant


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Watch clean streams and those with something concealed, in parallel."""
    first = FIRST_SEED * (1 + seed)
    seconds = QUICK_SECONDS if quick else SECONDS
    clean = in_parallel(
        watch_clean, [(first + k, seconds) for k in range(QUICK_STREAMS if quick else STREAMS)], "streams"
    )
    jobs = [(effect, first + k) for effect in (QUICK_EFFECTS if quick else DRAWS) for k in range(1 if quick else SEEDS)]
    late = in_parallel(watch_effect, jobs, "cases")
    return Measured(rows_of(clean, late), {"clean": [asdict(c) for c in clean], "effects": [asdict(c) for c in late]})


def rows_of(clean: Sequence[Clean], late: Sequence[Late]) -> list[Row]:
    """Return the acceptance rows."""
    known = [each for each in late if not math.isnan(each.significant)]
    loose = [each for each in late if not math.isnan(each.significant_at_5_percent)]
    delays = [each.delay for each in known]
    in_time = sum(delay <= IN_TIME for delay in delays)
    alarmed = sum(each.alarms > 0 for each in clean)
    lags = [each.alarm - each.significant_at_5_percent for each in loose if not math.isnan(each.alarm)]
    minutes = sum(each.seconds for each in clean) / 60.0
    return [
        at_most(
            f"alarms in {minutes:.0f} min of clean pushing, {len(clean)} tables",
            sum(each.alarms for each in clean),
            "1",
            0.0,
            streams_with_an_alarm=interval(alarmed, len(clean)),
            highest_statistic=max((each.highest for each in clean), default=math.nan),
            threshold=MonitorOptions().threshold,
        ),
        at_most("alarm after it is significant, median", float(np.median(delays)) if delays else math.nan, "s", 2.0),
        at_least(
            f"alarms within 2 s of significance, share of {len(known)} significant cases",
            in_time / len(known) if known else math.nan,
            "1",
            1.0,
            interval=interval(in_time, len(known)),
            missed=sum(math.isinf(delay) for delay in delays),
            largest_delay=max((delay for delay in delays if math.isfinite(delay)), default=math.nan),
        ),
        at_most(
            "alarm after the batch test first says p < 0.05, median of those with an alarm",
            float(np.median(lags)) if lags else math.nan,
            "s",
            2.0,
            never_an_alarm=sum(math.isnan(each.alarm) for each in loose),
            cases=len(loose),
        ),
    ]


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
    return Late(effect, seed, strength, alarms[0][0] if alarms else math.nan, strict, loose)


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
) -> list[float]:
    """Return when the batch test first gave a p-value below each level [s], NaN where it never did."""
    found = [math.nan] * len(levels)
    for now in np.arange(recording.grasps[0].start + 1.5, recording.grasps[-1].end + SCAN, SCAN).tolist():
        try:
            p_value = batch_p_value(recording, posterior, now, options)
        except (BagError, ModelError):  # a hold is not long enough yet
            continue
        found = [now if math.isnan(f) and p_value < level else f for f, level in zip(found, levels, strict=True)]
        if not any(map(math.isnan, found)):
            break
    return found
