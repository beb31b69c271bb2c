"""A process of its own for the rivals, given a recording and no truth: `python -m pbrl_bringup.rivals.run BAG OUT`."""

from __future__ import annotations

import sys
from dataclasses import asdict
from pathlib import Path

from pbrl_bag import read_recording
from pbrl_bringup.files import write_json
from pbrl_bringup.rivals.claim import Claim, Given, Rival, give
from pbrl_bringup.rivals.gaussian_process import gaussian_process
from pbrl_bringup.rivals.lisdd import lisdd
from pbrl_bringup.rivals.refit import refit
from pbrl_bringup.rivals.sindy import sindy
from pbrl_mismatch.options import DiagnoseOptions

RIVALS: dict[str, Rival] = {"refit": refit, "Gaussian process": gaussian_process, "SINDy": sindy, "LISDD": lisdd}
"""Every rival by the name in its claims."""


def claims_of(given: Given) -> list[Claim]:
    """Return what every rival says."""
    return [rival(given) for rival in RIVALS.values()]


def main(bag: str, out: str, mass_spread: str | None = None) -> int:
    """Write every rival's claim on a bag as JSON.

    Args:
        bag: folder.
        out: file.
        mass_spread: how well the nominal mass is known; None: the library's default.
    """
    options = DiagnoseOptions() if mass_spread is None else DiagnoseOptions(mass_spread=float(mass_spread))
    given = give(read_recording(Path(bag)), options)
    write_json(Path(out), [asdict(claim) for claim in claims_of(given)])
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
