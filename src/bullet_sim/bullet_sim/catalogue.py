"""What stands in a room: office tables on casters, blocks that slide, fixtures that do not move.

A body's own frame has its origin where its tag is glued, x forward and y left; outlines are seen from above.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from shapely.geometry import Point, Polygon

from bullet_sim.settings import NonNegative, Outline, Positive, Settings, Vector2, Vector3

Array = NDArray[np.float64]


class CasterSettings(Settings):
    """One make of caster; numbers of a 75 mm caster under an office table.

    Attributes:
        radius: of the wheel [m].
        trail: horizontal distance from swivel axis to axle [m].
        height: floor to the plate on top of the fork [m].
        rolling_resistance: lever f [m] of the rolling resistance f N / radius; 0.75 mm is polyurethane on a hard
            floor, 2.4 mm hard rubber on tile, 4.5 mm on carpet.
        swivel_friction: Coulomb torque of the swivel's bearing [N m].
        sliding_friction: Coulomb coefficient of the tread on a floor of friction 1.
        contact_width: width [m] of the tread that bears on the floor (treads are crowned); a wheel turned on the
            spot scrubs with a torque of sliding_friction N contact_width / 4.
        wheel_mass: [kg].
        fork_mass: [kg].
    """

    radius: Positive = 0.0375
    trail: NonNegative = 0.028
    height: Positive = 0.100
    rolling_resistance: NonNegative = 0.00075
    swivel_friction: NonNegative = 0.04
    sliding_friction: Positive = 0.7
    contact_width: NonNegative = 0.008
    wheel_mass: Positive = 0.25
    fork_mass: Positive = 0.20

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.height < 2 * self.radius:
            raise ValueError(f"expected a caster height of at least the wheel's diameter, got {self.height} m")
        return self


class OfficeTable(Settings):
    """A slab on four legs on four casters.

    Attributes:
        size: extent along the body's x and y [m].
        height: top face above the floor [m].
        slab: thickness of the top [m]; its edge is what a gripper clamps.
        nominal_mass: what the robot is told, casters included [kg].
        pose: (x, y, theta) of the tag, which is glued on the middle of the top.
        leg_inset: from the edges to the legs' middle [m].
        casters: the make of all four.
        caster_positions: swivel axes [m] by name in the body's frame; default: under the four legs.
    """

    kind: Literal["office_table"]
    size: tuple[Positive, Positive]
    height: Positive
    slab: Positive = 0.025
    nominal_mass: Positive
    pose: Vector3
    leg_inset: Positive = 0.06
    casters: CasterSettings = CasterSettings()
    caster_positions: dict[str, Vector2] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _stands(self) -> Self:
        if self.height <= self.casters.height + self.slab:
            raise ValueError(f"expected a height above casters and slab, got {self.height} m")
        if min(self.size) <= 2 * self.leg_inset:
            raise ValueError(f"expected a size of more than two leg insets, got {list(self.size)} m")
        places = list(self.swivels.values())
        if len(places) < 3 or not Polygon(places).convex_hull.buffer(-1e-3).contains(Point(0, 0)):
            raise ValueError("caster_positions: expected at least three casters around the table's middle")
        if any(abs(x) > self.size[0] / 2 or abs(y) > self.size[1] / 2 for x, y in places):
            raise ValueError("caster_positions: expected casters under the table, got one outside its size")
        light = len(places) * (self.casters.wheel_mass + self.casters.fork_mass)
        if self.nominal_mass <= 2 * light:
            raise ValueError(
                f"nominal_mass: expected over twice its casters' {light:.2f} kg, got {self.nominal_mass} kg"
            )
        return self

    @property
    def footprint(self) -> Array:
        """Corners (4, 2) [m] seen from above, counter-clockwise, in the body's frame."""
        x, y = self.size[0] / 2, self.size[1] / 2
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid; below a table's top there is room."""
        return self.height - self.slab, self.height

    @property
    def swivels(self) -> dict[str, Vector2]:
        """Swivel axes [m] by caster name in the body's frame; front is +x, left is +y."""
        x, y = self.size[0] / 2 - self.leg_inset, self.size[1] / 2 - self.leg_inset
        four = {"front_left": (x, y), "front_right": (x, -y), "rear_left": (-x, y), "rear_right": (-x, -y)}
        return dict(self.caster_positions) or four


class Block(Settings):
    """A prism that stands on the floor and slides when pushed.

    Attributes:
        polygon: outline [m] in the body's frame.
        height: [m].
        nominal_mass: [kg].
        friction: Coulomb coefficient on a floor of friction 1.
        pose: (x, y, theta) of the body's frame.
    """

    kind: Literal["block"]
    polygon: Outline
    height: Positive
    nominal_mass: Positive
    friction: Positive = 0.4
    pose: Vector3

    @property
    def footprint(self) -> Array:
        """Corners (k, 2) [m] seen from above, counter-clockwise, in the body's frame."""
        return np.array(self.polygon)

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid."""
        return 0.0, self.height


class Fixture(Settings):
    """A prism built into the room.

    Attributes:
        polygon: outline [m] in the body's frame.
        height: [m].
        pose: (x, y, theta) of the body's frame.
    """

    kind: Literal["fixture"]
    polygon: Outline
    height: Positive
    pose: Vector3 = (0.0, 0.0, 0.0)

    @property
    def footprint(self) -> Array:
        """Corners (k, 2) [m] seen from above, counter-clockwise, in the body's frame."""
        return np.array(self.polygon)

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid."""
        return 0.0, self.height


Body = Annotated[OfficeTable | Block | Fixture, Field(discriminator="kind")]
