"""Settings of random office rooms and of what is hidden in their furniture."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.settings import NotNegative, Positive, Section

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class OfficeSettings(Section):
    """What a random office is like."""

    area_per_thing: Positive = 7.0  # [m^2] of floor for each movable thing: rooms grow with their number
    things_per_room: Positive = 5.0  # on average, behind one door
    wall: Positive = 0.10  # [m] thickness of partition walls: studs and board
    doors: tuple[Positive, ...] = (1.20, 1.50, 1.80)  # [m] clear widths of wide single and of double doors
    extra_doors: Share = 0.3  # of the walls between rooms that would not need one
    blocked: Share = 0.6  # of the doors before or in which something stands
    counters: Share = 0.7  # of the rooms that have a built-in desk or cupboard along a wall
    counter_depth: tuple[Positive, Positive] = (0.45, 0.75)  # [m] from, to: a cupboard, a desk
    counter_length: tuple[Positive, Positive] = (1.2, 2.2)  # [m] from, to
    gap: NotNegative = 0.03  # [m] at least between two things
    squared: Share = 0.7  # of the things that stand along the walls, but for a few degrees
    askew: NotNegative = 0.08  # [rad] of those few degrees, standard deviation
    clearance: NotNegative = 0.03  # [m] around the robot where it starts and ends, wherever it looks
    apart: NotNegative = 2.5  # [m] between start and goal at least
    attempts: Annotated[int, Field(ge=1)] = 50  # rooms that are drawn until one is as asked


class HiddenSettings(Section):
    """How often furniture is other than it looks; what is left over is free on its casters."""

    locked_caster: Share = 0.25  # one caster's wheel and swivel are braked
    static: Share = 0.15  # two are
    heavy: Share = 0.15  # weighs more than anybody would guess
    heavier: tuple[Positive, Positive] = (1.4, 2.0)  # times the guess, from, to
