"""What stands in a room: tables and carts on casters, plain tables, blocks that slide, fixtures that do not move.

A body's own frame has its origin where its tag is glued, x forward and y left; outlines are seen from above.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from shapely.geometry import Point, Polygon

from bullet_sim.settings import NonNegative, Outline, Positive, Settings, Vector2, Vector3

Array = NDArray[np.float64]

FOOT_RADIUS = 0.02
"""Of a ball foot [m]."""


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
        scrub_length: a wheel that rolls while it turns lays down fresh tread, and that is twisted less: its scrub
            torque is min(1, scrub_length |turn rate| / speed) times that on the spot. About half the length of the
            patch (3 mm) over the twist at which all of it slides (0.15 rad) [m]; None: as on the spot at any speed,
            which is the worst case.
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
    scrub_length: NonNegative | None = None
    wheel_mass: Positive = 0.25
    fork_mass: Positive = 0.20

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.height < 2 * self.radius:
            raise ValueError(f"expected a caster height of at least the wheel's diameter, got {self.height} m")
        return self


class OnCasters(Settings):
    """What all bodies on casters have in common.

    Attributes:
        size: extent along the body's x and y [m].
        height: top face above the floor [m].
        nominal_mass: what the robot is told, casters included [kg].
        pose: (x, y, theta) of the tag, which is glued on the middle of the top.
        casters: the make of all of them.
        caster_positions: swivel axes [m] by name in the body's frame; default: four, under its corners.
    """

    size: tuple[Positive, Positive]
    height: Positive
    nominal_mass: Positive
    pose: Vector3
    casters: CasterSettings = CasterSettings()
    caster_positions: dict[str, Vector2] = Field(default_factory=dict)

    @property
    def footprint(self) -> Array:
        """Corners (4, 2) [m] seen from above, counter-clockwise, in the body's frame."""
        x, y = self.size[0] / 2, self.size[1] / 2
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])

    @property
    @abstractmethod
    def corner(self) -> Vector2:
        """Where the front left caster is [m] unless `caster_positions` says otherwise; the others mirror it."""

    @property
    def swivels(self) -> dict[str, Vector2]:
        """Swivel axes [m] by caster name in the body's frame; front is +x, left is +y."""
        x, y = self.corner
        four = {"front_left": (x, y), "front_right": (x, -y), "rear_left": (-x, y), "rear_right": (-x, -y)}
        return dict(self.caster_positions) or four

    def _check_casters(self, what: str) -> None:
        """Raise ValueError where the casters do not carry the body; `what` is its kind, for the message."""
        places = list(self.swivels.values())
        if len(places) < 3 or not Polygon(places).convex_hull.buffer(-1e-3).contains(Point(0, 0)):
            raise ValueError(f"caster_positions: expected at least three casters around the {what}'s middle")
        if any(abs(x) > self.size[0] / 2 or abs(y) > self.size[1] / 2 for x, y in places):
            raise ValueError(f"caster_positions: expected casters under the {what}, got one outside its size")
        light = len(places) * (self.casters.wheel_mass + self.casters.fork_mass)
        if self.nominal_mass <= 2 * light:
            raise ValueError(
                f"nominal_mass: expected over twice its casters' {light:.2f} kg, got {self.nominal_mass} kg"
            )


class OfficeTable(OnCasters):
    """A slab on four legs, a caster under each.

    Attributes:
        slab: thickness of the top [m]; its edge is what a gripper clamps.
        leg_inset: from the edges to the legs' middle [m].
    """

    kind: Literal["office_table"]
    slab: Positive = 0.025
    leg_inset: Positive = 0.06

    @model_validator(mode="after")
    def _stands(self) -> Self:
        if self.height <= self.casters.height + self.slab:
            raise ValueError(f"expected a height above casters and slab, got {self.height} m")
        if min(self.size) <= 2 * self.leg_inset:
            raise ValueError(f"expected a size of more than two leg insets, got {list(self.size)} m")
        self._check_casters("table")
        return self

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid; below a table's top there is room."""
        return self.height - self.slab, self.height

    @property
    def corner(self) -> Vector2:
        """Under the front left leg [m]."""
        return self.size[0] / 2 - self.leg_inset, self.size[1] / 2 - self.leg_inset


class CartCasters(CasterSettings):
    """A 125 mm caster, as carts have; the numbers mean what they mean in `CasterSettings`."""

    radius: Positive = 0.0625
    trail: NonNegative = 0.040
    height: Positive = 0.156
    contact_width: NonNegative = 0.010
    scrub_length: NonNegative | None = 0.02
    wheel_mass: Positive = 0.55
    fork_mass: Positive = 0.45


class UtilityCart(OnCasters):
    """Two shelves between four posts, and at the height of the upper one a push bar along each short end.

    Attributes:
        bar: diameter of the push bars [m], and thickness of the shelves; a bar is what a gripper clamps.
        bar_gap: between a bar and the upper shelf [m].
        lower_shelf: height of the lower shelf's top face [m].
        caster_inset: from the shelf's edges to the swivel axes [m].
        upper_shelf: whether it has one; without it, what a laser sees over the cart is the room, and there is only the
            bars to clamp.
    """

    kind: Literal["utility_cart"]
    casters: CartCasters = CartCasters()
    bar: Positive = 0.032
    bar_gap: Positive = 0.060
    lower_shelf: Positive = 0.30
    caster_inset: Positive = 0.05
    upper_shelf: bool = True

    @model_validator(mode="after")
    def _stands(self) -> Self:
        if not self.casters.height + self.bar < self.lower_shelf < self.height - self.bar:
            raise ValueError(f"lower_shelf: expected a height between casters and top, got {self.lower_shelf} m")
        if min(self.shelf) <= 2 * self.caster_inset:
            raise ValueError(f"expected shelves of more than two caster insets, got {list(self.shelf)} m")
        self._check_casters("cart")
        return self

    @property
    def shelf(self) -> Vector2:
        """Extent of the shelves along the body's x and y [m]: its size without bars and gaps."""
        return self.size[0] - 2 * (self.bar + self.bar_gap), self.size[1]

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid."""
        return self.lower_shelf - self.bar, self.height

    @property
    def corner(self) -> Vector2:
        """Under the front left corner of the shelves [m]."""
        return self.shelf[0] / 2 - self.caster_inset, self.shelf[1] / 2 - self.caster_inset


class PlainTable(Settings):
    """A table in the model's own class: mass spread evenly over its outline, on feet without friction.

    Its feet are balls that bear on one point each, as ball transfer units do. What it lacks (friction, casters, a
    load) can be concealed in it, one thing at a time.

    Attributes:
        size: extent along the body's x and y [m].
        height: top face above the floor [m].
        nominal_mass: what the robot is told [kg].
        pose: (x, y, theta) of the tag, which is glued on the middle of the top.
        slab: thickness of the top [m]; its edge is what a gripper clamps.
        leg_inset: from the edges to the legs' middle [m].
    """

    kind: Literal["plain_table"]
    size: tuple[Positive, Positive]
    height: Positive = 0.7775
    nominal_mass: Positive
    pose: Vector3
    slab: Positive = 0.025
    leg_inset: Positive = 0.06

    @model_validator(mode="after")
    def _stands(self) -> Self:
        if self.height <= self.slab + 2 * FOOT_RADIUS:
            raise ValueError(f"expected a height above feet and slab, got {self.height} m")
        if min(self.size) <= 2 * self.leg_inset:
            raise ValueError(f"expected a size of more than two leg insets, got {list(self.size)} m")
        return self

    @property
    def footprint(self) -> Array:
        """Corners (4, 2) [m] seen from above, counter-clockwise, in the body's frame."""
        x, y = self.size[0] / 2, self.size[1] / 2
        return np.array([[-x, -y], [x, -y], [x, y], [-x, y]])

    @property
    def feet(self) -> dict[str, Vector2]:
        """Where the feet are [m] by name in the body's frame; front is +x, left is +y."""
        x, y = self.size[0] / 2 - self.leg_inset, self.size[1] / 2 - self.leg_inset
        return {"front_left": (x, y), "front_right": (x, -y), "rear_left": (-x, y), "rear_right": (-x, -y)}

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid; below the top there is room."""
        return self.height - self.slab, self.height


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
        height: of its upper face [m].
        underside: height of its lower face [m]: 0 for what stands on the floor, more for what is fixed to a wall.
        pose: (x, y, theta) of the body's frame.
    """

    kind: Literal["fixture"]
    polygon: Outline
    height: Positive
    underside: NonNegative = 0.0
    pose: Vector3 = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _has_thickness(self) -> Self:
        if self.underside >= self.height:
            raise ValueError(f"expected an underside below the height {self.height:g} m, got {self.underside:g} m")
        return self

    @property
    def footprint(self) -> Array:
        """Corners (k, 2) [m] seen from above, counter-clockwise, in the body's frame."""
        return np.array(self.polygon)

    @property
    def levels(self) -> tuple[float, float]:
        """Heights [m] between which the footprint is solid."""
        return self.underside, self.height


Body = Annotated[OfficeTable | UtilityCart | PlainTable | Block | Fixture, Field(discriminator="kind")]
