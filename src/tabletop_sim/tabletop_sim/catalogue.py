"""Items that come with the workspace, as they are on desks and laid tables; sizes and masses are those of common ones.

What an item rests on is the physics that robots are to find out: felt rubs everywhere alike, four rubber feet at the
corners hold and then break loose, batteries make one end of a remote heavy. None of that is told to anybody.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from bullet_sim.errors import nearest
from bullet_sim.settings import Positive, Settings, Vector2, Vector3

Side = Annotated[float, Field(ge=0.01, le=1.0)]
Friction = Annotated[float, Field(ge=0.05, le=1.5)]

KINDS: dict[str, dict[str, object]] = {
    "eraser": {"length": 0.13, "width": 0.05, "height": 0.03, "mass": 0.06, "friction": 0.55, "breakaway": 1.1},
    "remote": {
        "length": 0.18, "width": 0.05, "height": 0.022, "mass": 0.13, "friction": 0.35, "centre": (-0.02, 0.0),
    },
    "scale": {
        "length": 0.20, "width": 0.16, "height": 0.035, "mass": 0.55, "friction": 0.75, "breakaway": 1.35,
        "rests_on": "feet",
    },
    "hole_punch": {"length": 0.12, "width": 0.08, "height": 0.06, "mass": 0.7, "friction": 0.8, "obstacle": True},
    "plate": {"length": 0.13, "width": 0.13, "height": 0.02, "mass": 0.3, "friction": 0.45},
    "platter": {"length": 0.20, "width": 0.12, "height": 0.022, "mass": 0.45, "friction": 0.4},
    "box": {},
}  # fmt: skip
"""What is known of each kind where a scene says nothing else; of a box, nothing."""


class DeskItem(Settings):
    """An item on the table: a box, seen from above.

    Attributes:
        kind: one of `KINDS`; what a scene does not say is taken from there.
        pose: (x, y, theta) of its middle in `world` [m, rad].
        length, width, height: of its box [m], the longer side first.
        mass: [kg].
        friction: sliding, against the table.
        breakaway: friction that holds over that which slides.
        rests_on: felt under all of it, or four feet near its corners.
        centre: of mass, from its middle (x, y) [m].
        obstacle: it must not be touched, which everybody is told; what touches it moves it.
    """

    kind: str = "box"
    pose: Vector3
    length: Side
    width: Side
    height: Annotated[float, Field(ge=0.01, le=0.1)]
    mass: Positive
    friction: Friction
    breakaway: Annotated[float, Field(ge=1.0, le=3.0)] = 1.0
    rests_on: Literal["felt", "feet"] = "felt"
    centre: Vector2 = (0.0, 0.0)
    obstacle: bool = False

    @model_validator(mode="before")
    @classmethod
    def _with_what_its_kind_has(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        kind = data.get("kind", "box")
        if not isinstance(kind, str) or kind not in KINDS:
            raise ValueError(f"kind: unknown kind {kind!r}; {nearest(str(kind), KINDS)}")
        return {**KINDS[kind], **data}

    @model_validator(mode="after")
    def _is_a_box(self) -> Self:
        if self.width > self.length:
            raise ValueError(f"expected the longer side first, got {self.length} and {self.width} m")
        if abs(self.centre[0]) > 0.3 * self.length or abs(self.centre[1]) > 0.3 * self.width:
            raise ValueError(f"centre: expected it within the middle of the item, got {list(self.centre)} m")
        return self
