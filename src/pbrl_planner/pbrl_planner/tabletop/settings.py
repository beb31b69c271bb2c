"""What the task-space search can be told."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.settings import NotNegative, Positive, Section


class TabletopSettings(Section):
    """Everything of the search.

    Attributes:
        travels: [m] that the ball goes in a push. The thesis's is 5 cm; a short one sets an item right in the end.
        approach: [m] between ball and item as a push begins.
        margin: [m] that items keep from each other and from the ball.
        sureness: standard deviations of a push's outcome that are kept free around it on top.
        touching: [m] by which items may seem to overlap where a search begins: they touch, and cameras err.
        epsilon: share of the steps that go to a random layout, the others go to the best that the descent knows.
        orientation: [m/rad] that an angle counts as a way in the metric (11). The thesis weighs 40 to 1, its unit of
            length is not given; with centimetres it is 0.4 m for a radian.
        descent: use DIRECTGD; without it the greedy steps go to the best layout in the tree.
        descents: that are begun each time, one of them in the tree's best layout.
        climb: go on from the best layout by whatever push the objective likes most; the thesis does not.
        carry: bring each item alone to its place in a good layout, by A*; the thesis does not.
        push_cost: by which the objective has to fall for a push to be worth making.
        every: steps between two times that the descent is asked.
        nodes: most in the tree.
        time_limit: [s] for all of it.
        shorten: leave out pushes that are not needed, of the plan that is found.
    """

    travels: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.05, 0.015)
    approach: Positive = 0.01
    margin: NotNegative = 0.004
    sureness: NotNegative = 1.0
    touching: NotNegative = 0.008
    epsilon: Annotated[float, Field(ge=0.0, le=1.0)] = 0.8
    orientation: Positive = 0.4
    descent: bool = True
    descents: Annotated[int, Field(ge=1, le=1000)] = 4
    climb: bool = True
    carry: bool = True
    push_cost: NotNegative = 0.001
    every: Annotated[int, Field(ge=1)] = 200
    nodes: Annotated[int, Field(ge=2, le=1_000_000)] = 20_000
    time_limit: Positive = 10.0
    shorten: bool = True
