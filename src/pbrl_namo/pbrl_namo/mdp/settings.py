"""Settings of the upper level."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.settings import Positive, Section


class MdpSettings(Section):
    """Value iteration over regions.

    Attributes:
        terminal: reward of being in the goal's region (thesis 6.5: 200).
        gamma: discount for each manipulation.
        tolerance: change of a value in one sweep below which values stand.
        sweeps: at most.
        expand: which openings are estimated: "needed" ones, those that a best policy from the start may use; "all".
    """

    terminal: Positive = 200.0
    gamma: Annotated[float, Field(ge=0.0, le=1.0)] = 0.95
    tolerance: Positive = 1e-9
    sweeps: Annotated[int, Field(ge=1)] = 100_000
    expand: Annotated[str, Field(pattern="^(needed|all)$")] = "needed"
