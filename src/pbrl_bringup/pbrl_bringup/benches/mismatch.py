"""The watch over a stream: no alarm while a table is pushed cleanly for half an hour, and how late it is if not.

What is done is kept case by case: a bench that was stopped goes on where it was.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from pbrl_bringup.benches.carried import Carried
from pbrl_bringup.benches.concealed_rows import interval
from pbrl_bringup.benches.mismatch_streams import Clean, Late, clean_stream, concealed_stream
from pbrl_bringup.benches.rows import Measured, Row, at_least, at_most
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.errors import BringupError
from pbrl_bringup.parallel import in_parallel
from pbrl_bringup.terminal import say
from pbrl_mismatch.online.options import MonitorOptions

FIRST_SEED = 10_000
"""Scored seeds begin here; those below are for development."""
STREAMS, QUICK_STREAMS = 2, 1
"""Tables that are pushed cleanly."""
SECONDS, QUICK_SECONDS = 1800.0, 100.0
"""For which each of them is held."""
SEEDS = 2
"""Cases of each effect."""
QUICK_EFFECTS = ("external_force", "floor_patch")
IN_TIME = 2.0

CARRIED = Carried(
    ("clean/*.json", "cases/*.json"),
    (
        "bullet_sim",
        "pbrl_bag",
        "pbrl_bringup.benches.mismatch_streams",
        "pbrl_bringup.concealed",
        "pbrl_mismatch",
        "pbrl_model",
    ),
)


def measure(seed: int, quick: bool, out: Path, *, minutes: float | None = None) -> Measured:
    """Watch clean streams and those with something concealed, in parallel.

    Args:
        seed: which of the scored seeds; no two seeds share a recording.
        quick: a shorter stream, and two effects.
        out: folder of results; what it holds of an earlier run of this seed is not done again.
        minutes: after which no stream is begun, and what there is is reported; None: all are done.

    Raises:
        BringupError: other streams are kept there, or there was no time for a single one.
    """
    first = FIRST_SEED * (1 + seed)
    until = None if minutes is None else time.time() + 60.0 * minutes
    seconds, cases = (QUICK_SECONDS, 1) if quick else (SECONDS, SEEDS)
    streams = [(first + k, seconds, out / "clean", until) for k in range(QUICK_STREAMS if quick else STREAMS)]
    effects = [
        (effect, first + k, out / "cases", until)
        for k in range(cases)
        for effect in (QUICK_EFFECTS if quick else DRAWS)
    ]
    clean = [each for each in in_parallel(clean_stream, streams, "clean streams") if each is not None]
    late = [each for each in in_parallel(concealed_stream, effects, "cases") if each is not None]
    left = len(streams) + len(effects) - len(clean) - len(late)
    if not clean and not late:
        raise BringupError("--minutes: expected time for one stream at least; give more")
    if left:
        say(f"{left} of {len(streams) + len(effects)} streams were not begun; the same command goes on")
    details = {"clean": [asdict(c) for c in clean], "effects": [asdict(c) for c in late], "not_begun": left}
    return Measured(rows_of(clean, late), details)


def rows_of(clean: Sequence[Clean], late: Sequence[Late]) -> list[Row]:
    """Return the acceptance rows, of what was watched."""
    return (_of_clean(clean) if clean else []) + (_of_late(late) if late else [])


def _of_clean(clean: Sequence[Clean]) -> list[Row]:
    return [
        at_most(
            f"alarms in {sum(each.seconds for each in clean) / 60.0:.0f} min of clean pushing, {len(clean)} tables",
            sum(each.alarms for each in clean),
            "1",
            0.0,
            streams_with_an_alarm=interval(sum(each.alarms > 0 for each in clean), len(clean)),
            highest_statistic=max(each.highest for each in clean),
            threshold=MonitorOptions().threshold,
        )
    ]


def _of_late(late: Sequence[Late]) -> list[Row]:
    delays = [each.delay for each in late if each.delay is not None]
    seen = [delay for delay in delays if delay < float("inf")]
    in_time = sum(delay <= IN_TIME for delay in delays)
    loose = [(each.alarm, each.significant_at_5_percent) for each in late if each.significant_at_5_percent is not None]
    lags = [alarm - significant for alarm, significant in loose if alarm is not None]
    nothing = float("nan")
    return [
        at_most(
            "alarm after it is significant, median", statistics.median(delays) if delays else nothing, "s", IN_TIME
        ),
        at_least(
            f"alarms within {IN_TIME:g} s of significance, share of {len(delays)} significant cases",
            in_time / len(delays) if delays else nothing,
            "1",
            1.0,
            interval=interval(in_time, len(delays)),
            missed=len(delays) - len(seen),
            largest_delay=max(seen, default=nothing),
        ),
        at_most(
            "alarm after the batch test first says p < 0.05, median of those with an alarm",
            statistics.median(lags) if lags else nothing,
            "s",
            IN_TIME,
            never_an_alarm=len(loose) - len(lags),
            cases=len(loose),
        ),
    ]
