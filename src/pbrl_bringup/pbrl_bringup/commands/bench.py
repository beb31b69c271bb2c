"""`./pbrl bench NAME`: measure, print a table and, as the last line, the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbrl_bringup.commands.measured import run_measured
from pbrl_bringup.errors import BringupError
from pbrl_bringup.measurable import BENCHES, WITH_CARRY, WITH_MINUTES, WITH_MOST, WITH_SETS


def command(
    name: str,
    out: Path | None,
    seed: int,
    quick: bool,
    sets: list[str],
    most: int | None,
    minutes: float | None = None,
    carry: Path | None = None,
    scheduler: str | None = None,
) -> int:
    """Run one bench.

    Args:
        name: of the bench.
        out: folder of the report; None: out/bench/NAME.
        seed: of every random draw.
        quick: whether to do a smaller version.
        sets: which sets of cases, for a bench that has some; none: all.
        most: recordings an effect at most, or hostile inputs in all, for a bench that has sets; None: all.
        minutes: after which such a bench begins no recording, or gives no further input; None: it does all.
        carry: file of cases that are done, to which those done now are added; None: they stay in the folder.
        scheduler: where its independent parts are done; None: in processes of this machine.

    Raises:
        BringupError: there is no bench of that name, it has no such option, no set of such a name, or there is no such
            scheduler.
    """
    if sets and name in BENCHES and name not in WITH_SETS:
        raise BringupError(
            f"bench {name}: expected no --sets, got {', '.join(sets)}; {' and '.join(WITH_SETS)} have some"
        )
    if most is not None and name in BENCHES and name not in WITH_MOST:
        raise BringupError(
            f"bench {name}: expected no --most, got {most}; {' and '.join(WITH_MOST)} have cases to count"
        )
    if minutes is not None and name in BENCHES and name not in WITH_MINUTES:
        raise BringupError(
            f"bench {name}: expected no --minutes, got {minutes:g}; {' and '.join(WITH_MINUTES)} can end after a time"
        )
    if carry is not None and name in BENCHES and name not in WITH_CARRY:
        raise BringupError(
            f"bench {name}: expected no --carry, got {carry}; {', '.join(WITH_CARRY)} take hours and can be carried"
        )
    if scheduler is not None and name == "scale":
        raise BringupError(f"bench scale: expected no --scheduler, got {scheduler}; it compares clusters of its own")
    more: dict[str, Any] = {"sets": sets} if sets else {}
    more |= {} if most is None else {"most": most}
    more |= {} if minutes is None else {"minutes": minutes}
    return run_measured("bench", BENCHES, name, out, seed, quick, more, scheduler, carry)
