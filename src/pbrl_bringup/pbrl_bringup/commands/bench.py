"""`./pbrl bench NAME`: measure, print a table and, as the last line, the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pbrl_bringup.commands.measured import run_measured
from pbrl_bringup.errors import BringupError

BENCHES = {
    "sim": "a pushed table against a hand calculation, kinematics, speed",
    "wheel": "the wheel of tables with a locked caster, and held-out prediction",
    "cabinet": "two real cabinets pulled by a real PR2: hinge, catch, held-out force",
    "recorder": "a recorder killed in mid-run",
    "mcap": "recordings read by two independent readers",
    "kernel": "steps a second of the compiled world model, against pymunk",
    "inference": "posterior and evidence of one wheel, ours against others given the same likelihood",
    "pose": "a wheel's place from pushes of random tables",
    "calibration": "ranks of the truth among posterior draws, over the prior",
    "concealed": "recordings with one thing concealed: is it noticed, named, and does the repair predict",
    "tags": "tags found in rendered pictures of six cameras, and the model of their noise, against the truth",
    "control": "the body controller: Jacobians, limits, tick, jitter, steering; object paths and grasps in Bullet",
    "cart": "robot and cart on a plan: how near they stay to it, ticks, costmaps, a laser that falls silent",
    "namo": "the planner among movable obstacles: time, unreachable goals, random rooms, against a kinodynamic RRT",
    "lattice": "the lattice planner: cubicles beside SBPL's figures, a cart through narrow doors, what a turn sweeps",
    "next-experiment": "pushes until it is known what was left out, chosen by information or at random",
    "foreign": "a push as five other laboratories would have recorded it: roles proposed, fitted like the native one",
    "played-again": "what is learned live, and from the recording of it played again: number for number",
    "two-robots": "two robots in one ROS domain, each in a namespace: both move a table out of the way and arrive",
    "view": "the viewer on ten minutes of five objects: first picture, pictures a second, console",
    "fuzz": "hostile files and messages by the thousand: each is read, or refused in one line",
    "kills": "nodes of the NAMO graph killed and frozen at every state: rest, mission, recording",
    "fence": "random and hostile missions beside places that are kept out of: how near robot and load come to them",
    "soak": "an hour of NAMO in random rooms: memory, handles, threads, deadlines, the recording",
    "mismatch": "the watch over a stream: half an hour of clean pushing without an alarm, and how late alarms are",
    "scale": "many recordings on a Dask cluster: two workers against one, a worker killed, a thousand queued",
}

WITH_SETS = ("concealed", "fuzz")
"""Benches whose cases come in sets."""
WITH_MOST = (*WITH_SETS, "kills", "fence")
"""Benches whose cases can be counted."""
WITH_MINUTES = (*WITH_MOST, "soak")
"""Benches that can end after a time."""


def command(
    name: str,
    out: Path | None,
    seed: int,
    quick: bool,
    sets: list[str],
    most: int | None,
    minutes: float | None = None,
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
    if scheduler is not None and name == "scale":
        raise BringupError(f"bench scale: expected no --scheduler, got {scheduler}; it compares clusters of its own")
    more: dict[str, Any] = {"sets": sets} if sets else {}
    more |= {} if most is None else {"most": most}
    more |= {} if minutes is None else {"minutes": minutes}
    return run_measured("bench", BENCHES, name, out, seed, quick, more, scheduler)
