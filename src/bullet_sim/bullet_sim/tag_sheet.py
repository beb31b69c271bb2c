"""Which tag is glued where: the sheet that whoever prints tags, simulates them or looks for them goes by.

The sheet is a file (`config/params/tags.yaml`), so that a real room has one too. A movable body that it does not name
wears one tag flat on its frame; see `worn_tags`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Self

import cv2
import numpy as np
from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from numpy.typing import NDArray
from pydantic import Field, model_validator

from bullet_sim.errors import SimError, nearest
from bullet_sim.settings import Positive, Settings, Vector3, read_settings

Array = NDArray[np.float64]

Number = Annotated[int, Field(ge=0, le=100_000)]
Component = Annotated[float, Field(ge=-1, le=1)]

DICTIONARIES = tuple(sorted(name for name in dir(cv2.aruco) if name.startswith("DICT_")))
"""Names of the families of tags that OpenCV knows."""


class TagMount(Settings):
    """One tag on a body.

    Attributes:
        id: of the tag in its dictionary.
        size: side of the black square [m].
        position: (3,) [m] of its middle in the body's frame; a plate is 2 mm thick.
        quaternion: (4,) x y z w of the tag in the body's frame: x to its right, y to its upper edge, z out of it.
    """

    id: Number
    size: Positive
    position: Vector3 = (0.0, 0.0, 0.002)
    quaternion: tuple[Component, Component, Component, Component] = (0.0, 0.0, 0.0, 1.0)

    @model_validator(mode="after")
    def _turns(self) -> Self:
        if abs(sum(part * part for part in self.quaternion) - 1.0) > 1e-3:
            raise ValueError(f"quaternion: expected a unit quaternion x y z w, got {list(self.quaternion)}")
        return self


class TagSheet(Settings):
    """All tags of a room.

    Attributes:
        dictionary: OpenCV's name of the family of tags.
        size: side of the black square [m] on a movable body that `tags` does not name.
        quiet: width of the white margin, as a share of the side.
        tags: by body, `left_gripper` and `right_gripper` included; a body may wear several.
    """

    dictionary: str = "DICT_APRILTAG_36h11"
    size: Positive = 0.20
    quiet: Annotated[float, Field(ge=0.05, le=1)] = 0.125
    tags: dict[str, tuple[TagMount, ...]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _is_one(self) -> Self:
        if self.dictionary not in DICTIONARIES:
            raise ValueError(f"dictionary: unknown {self.dictionary!r}; {nearest(self.dictionary, DICTIONARIES)}")
        numbers = [mount.id for mounts in self.tags.values() for mount in mounts]
        twice = next((number for number in numbers if numbers.count(number) > 1), None)
        if twice is not None:
            raise ValueError(f"tags: expected each id once, got {twice} twice")
        known = self.count
        if any(number >= known for number in numbers):
            raise ValueError(f"tags: expected ids below {known} of {self.dictionary}, got {max(numbers)}")
        return self

    @property
    def count(self) -> int:
        """How many tags the dictionary has."""
        return len(self.family.bytesList)

    @property
    def family(self) -> cv2.aruco.Dictionary:
        """OpenCV's dictionary."""
        return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))


def load_tag_sheet(path: Path | None = None) -> TagSheet:
    """Read a sheet.

    Args:
        path: a YAML file; None: the workspace's own.

    Raises:
        SimError: no such file, or a fault in it; one line.
    """
    if path is None:
        try:
            path = Path(get_package_share_directory("pbrl_config")) / "params" / "tags.yaml"
        except PackageNotFoundError as error:
            raise SimError("tags: expected the package pbrl_config, found none; build the workspace") from error
    return read_settings(path, TagSheet)


def worn_tags(sheet: TagSheet, bodies: Sequence[str]) -> Mapping[str, tuple[TagMount, ...]]:
    """Say which tags are in a room.

    Movable bodies that the sheet does not name get the lowest ids that it leaves free, in their order, flat on the
    middle of their frame.

    Args:
        sheet: of the room.
        bodies: names of the movable bodies, in the order of the scene.

    Returns:
        Mounts by name: `bodies` first, then what else the sheet has that is a gripper.

    Raises:
        SimError: the dictionary has too few tags.
    """
    taken = {mount.id for mounts in sheet.tags.values() for mount in mounts}
    free = iter(number for number in range(sheet.count) if number not in taken)
    worn: dict[str, tuple[TagMount, ...]] = {}
    for name in bodies:
        number = None if name in sheet.tags else next(free, -1)
        if number == -1:
            raise SimError(
                f"tags: expected at most {sheet.count} tags of {sheet.dictionary}, got more bodies than that"
            )
        worn[name] = sheet.tags[name] if number is None else (TagMount(id=number, size=sheet.size),)
    return worn | {name: mounts for name, mounts in sheet.tags.items() if name.endswith("_gripper")}
