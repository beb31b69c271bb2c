"""All rivals on what a diagnosis worked on."""

from __future__ import annotations

from pbrl_bringup.rivals.claim import Claim, Given, Rival
from pbrl_bringup.rivals.gaussian_process import gaussian_process
from pbrl_bringup.rivals.lisdd import lisdd
from pbrl_bringup.rivals.refit import refit
from pbrl_bringup.rivals.sindy import sindy

RIVALS: dict[str, Rival] = {"refit": refit, "Gaussian process": gaussian_process, "SINDy": sindy, "LISDD": lisdd}
"""Every rival by the name in its claims."""


def claims_of(given: Given) -> list[Claim]:
    """Return what every rival says."""
    return [rival(given) for rival in RIVALS.values()]
