"""How large a costmap is, what it believes of a scan and for how long, and how cost falls off from obstacles."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from pbrl_control.settings import NotNegative, Positive, Section

MOST_CELLS = 16_000_000
MOST_LEVELS = 60


class InflationSettings(Section):
    """Cost of a free cell at a distance d from the nearest lethal one, as ROS's navigation has it.

    Attributes:
        inscribed: [m] up to which a cell costs 253: the robot's centre cannot be there.
        radius: [m] beyond which a cell costs nothing.
        decay: [1/m]; between the two a cell costs 252 exp(-decay (d - inscribed)), rounded down.
    """

    inscribed: Annotated[NotNegative, Field(le=10.0)] = 0.33
    radius: Annotated[NotNegative, Field(le=10.0)] = 0.60
    decay: Positive = 10.0

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        if self.inscribed > self.radius:
            raise ValueError(f"expected inscribed at most radius, got {self.inscribed} and {self.radius} m")
        return self


class EvidenceSettings(Section):
    """What is believed of a cell. It is occupied while its evidence is above zero.

    Attributes:
        hit: evidence that a scan adds which ends in the cell.
        miss: evidence that a scan takes which sees through the cell.
        most: evidence at most: so soon is gone what has gone.
        confirmed: evidence from which an obstacle is taken for real.
        fleeting: [s] that an obstacle stays which is not confirmed, where nobody looks any more.
        memory: [s] that a confirmed one does.
    """

    hit: Annotated[int, Field(ge=1, le=100)] = 2
    miss: Annotated[int, Field(ge=1, le=100)] = 1
    most: Annotated[int, Field(ge=1, le=250)] = 8
    confirmed: Annotated[int, Field(ge=1, le=250)] = 6
    fleeting: Positive = 2.0
    memory: Positive = 30.0

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.hit <= self.most or not self.confirmed <= self.most:
            raise ValueError(f"expected hit and confirmed at most {self.most}, got {self.hit} and {self.confirmed}")
        if self.fleeting > self.memory:
            raise ValueError(f"expected fleeting at most memory, got {self.fleeting} and {self.memory} s")
        return self


class OverhangSettings(Section):
    """What a laser that nods sees over the floor, in columns of voxels as wide as a cell.

    Attributes:
        lowest: [m] over the floor from which something is in the way of robot or cart.
        highest: [m] up to which it is.
        level: height of a voxel [m].
        graze: [m] by which a beam has to be lower than the highest mark in a voxel to speak against it.
        mark_range: [m] along a beam up to which what it ends at is marked.
        clear_range: [m] up to which it frees what it passes.
        hit: evidence that a scan adds which ends in a voxel; it is occupied while its evidence is above zero.
        miss: evidence that a scan takes which sees through it.
        most: evidence at most.
        patch: [m] side of a patch of the floor, over which it is asked whether something has settled. A nod takes
            seconds, and the next one hits the same thing elsewhere: no voxel is seen often.
        settled: [s] between the first and the last mark over a patch from which it is taken for real: furniture stays,
            who walks has gone on.
        fleeting: [s] that marks stay over a patch where nothing has settled, and nobody looks any more.
        memory: [s] that they do where something has.
        about: [m] about what stands on the floor, as the level laser sees it, within which what came over the floor
            together with it goes with it.
        slack: [s] between the two's coming, and between the two's last being seen.
    """

    lowest: Annotated[NotNegative, Field(le=10.0)] = 0.10
    highest: Annotated[Positive, Field(le=10.0)] = 1.70
    level: Annotated[Positive, Field(ge=0.02, le=1.0)] = 0.10
    graze: Annotated[NotNegative, Field(le=0.2)] = 0.03
    mark_range: Annotated[Positive, Field(le=100.0)] = 4.0
    clear_range: Annotated[Positive, Field(le=100.0)] = 5.0
    hit: Annotated[int, Field(ge=1, le=100)] = 2
    miss: Annotated[int, Field(ge=1, le=100)] = 1
    most: Annotated[int, Field(ge=1, le=250)] = 6
    patch: Annotated[Positive, Field(ge=0.02, le=2.0)] = 0.20
    settled: Positive = 1.5
    fleeting: Positive = 5.0
    memory: Positive = 60.0
    about: Annotated[NotNegative, Field(le=2.0)] = 0.35
    slack: NotNegative = 1.5

    @model_validator(mode="after")
    def _stacks(self) -> Self:
        if self.hit > self.most:
            raise ValueError(f"expected hit at most {self.most}, got {self.hit}")
        if not self.settled <= self.fleeting <= self.memory:
            raise ValueError(
                f"expected settled at most fleeting, and that at most memory, got {self.settled}, {self.fleeting} and "
                f"{self.memory} s"
            )
        if not 1 <= self.levels <= MOST_LEVELS:
            raise ValueError(
                f"expected highest above lowest by 1 to {MOST_LEVELS} levels of {self.level:g} m, got {self.lowest:g} "
                f"to {self.highest:g} m"
            )
        return self

    @property
    def levels(self) -> int:
        """Voxels of a column."""
        return round((self.highest - self.lowest) / self.level)


class CostmapSettings(Section):
    """Everything a costmap can be told.

    Attributes:
        resolution: of a cell [m].
        width: along x [m].
        height: along y [m].
        mark_range: [m] from the laser up to which obstacles are marked.
        clear_range: [m] up to which floor is cleared.
        own_margin: [m] about the outlines of robot and cart in which readings are taken for their own.
        unknown: what becomes of cells that nobody saw: cost 255, 0 or 254.
        unseen: cost at least of cells that are free by the map alone, up to 252: things stand there that no map has, so
            that it is better to go where somebody has looked.
        inflation: how cost falls off from obstacles.
        evidence: what is believed of a cell.
        overhang: what is believed of what a nodding laser sees.
    """

    resolution: Annotated[Positive, Field(ge=0.005, le=1.0)] = 0.025
    width: Annotated[Positive, Field(le=1000.0)] = 6.0
    height: Annotated[Positive, Field(le=1000.0)] = 6.0
    mark_range: Annotated[Positive, Field(le=100.0)] = 4.0
    clear_range: Annotated[Positive, Field(le=100.0)] = 5.0
    own_margin: Annotated[NotNegative, Field(le=0.5)] = 0.03
    unknown: Literal["unknown", "free", "lethal"] = "unknown"
    unseen: Annotated[int, Field(ge=0, le=252)] = 0
    inflation: InflationSettings = InflationSettings()
    evidence: EvidenceSettings = EvidenceSettings()
    overhang: OverhangSettings = OverhangSettings()

    @model_validator(mode="after")
    def _fits(self) -> Self:
        rows, columns = self.shape
        if min(rows, columns) < 3 or rows * columns > MOST_CELLS:
            raise ValueError(f"expected 3 cells either way and at most {MOST_CELLS}, got {columns} by {rows}")
        if self.mark_range > self.clear_range:
            raise ValueError(f"expected mark_range at most clear_range, got {self.mark_range}, {self.clear_range} m")
        return self

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return round(self.height / self.resolution), round(self.width / self.resolution)
