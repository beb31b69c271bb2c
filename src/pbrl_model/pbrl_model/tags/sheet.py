"""Which tag is glued where, read from `config/params/tags.yaml`.

The simulators read the same file with code of their own (they import nothing of this side); a test holds both readers
to each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from scipy.spatial.transform import Rotation

from pbrl_bag.yaml_text import parse_yaml
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]


class TagMount(BaseModel):
    """One tag on a body.

    Attributes:
        id: of the tag in its dictionary.
        size: side of the black square [m].
        position: (3,) [m] of its middle in the body's frame.
        quaternion: (4,) x y z w of the tag in the body's frame: x to its right, y to its upper edge, z out of it.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    id: int = Field(ge=0)
    size: float = Field(gt=0, le=10)
    position: tuple[float, float, float] = (0.0, 0.0, 0.002)
    quaternion: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)

    @property
    def corners(self) -> Array:
        """(4, 3) [m] in the body's frame, clockwise from the tag's upper left."""
        half = self.size / 2
        square = np.array([[-half, half, 0], [half, half, 0], [half, -half, 0], [-half, -half, 0]])
        return square @ Rotation.from_quat(self.quaternion).as_matrix().T + np.array(self.position)


class TagSheet(BaseModel):
    """All tags of a room.

    Attributes:
        dictionary: OpenCV's name of the family of tags.
        size: side of the black square [m] on a movable body that `tags` does not name.
        quiet: width of the white margin, as a share of the side; only who prints tags uses it.
        tags: by body, `left_gripper` and `right_gripper` included.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    dictionary: str = "DICT_APRILTAG_36h11"
    size: float = Field(default=0.20, gt=0, le=10)
    quiet: float = Field(default=0.125, ge=0.05, le=1)
    tags: dict[str, tuple[TagMount, ...]] = Field(default_factory=dict)


def load_tag_sheet(path: Path) -> TagSheet:
    """Read a sheet.

    Raises:
        ModelError: no such file, not YAML, a fault in it, or an id that is there twice; one line.
    """
    try:
        data = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(f"{path}: expected a readable YAML file, got {' '.join(str(error).split())}") from error
    try:
        sheet = TagSheet.model_validate(data)
    except ValidationError as error:
        fault = error.errors(include_url=False)[0]
        place = ".".join(str(step) for step in fault["loc"])
        raise ModelError(f"{path}: {place}: {fault['msg']}, got {str(fault['input'])[:60]}") from error
    numbers = [mount.id for mounts in sheet.tags.values() for mount in mounts]
    for number in numbers:
        if numbers.count(number) > 1:
            raise ModelError(f"{path}: tags: expected each id once, got {number} twice")
    for name, mounts in sheet.tags.items():
        for mount in mounts:
            if abs(float(np.dot(mount.quaternion, mount.quaternion)) - 1.0) > 1e-3:
                raise ModelError(f"{path}: tags.{name}: expected a unit quaternion, got {list(mount.quaternion)}")
    return sheet


def worn_tags(sheet: TagSheet, bodies: Sequence[str]) -> Mapping[str, tuple[TagMount, ...]]:
    """Say which tags are in a room.

    Movable bodies that the sheet does not name wear the lowest ids that it leaves free, in their order, flat on the
    middle of their frame.

    Args:
        sheet: of the room.
        bodies: names of the movable bodies, in the order of `/scene`.

    Returns:
        Mounts by name, those of all that the sheet names included.

    Raises:
        ModelError: the dictionary is unknown, or has too few tags.
    """
    number = getattr(cv2.aruco, sheet.dictionary, None) if sheet.dictionary.startswith("DICT_") else None
    if number is None:
        raise ModelError(f"dictionary: expected a family of cv2.aruco, got {sheet.dictionary!r}")
    count = len(cv2.aruco.getPredefinedDictionary(number).bytesList)
    taken = {mount.id for mounts in sheet.tags.values() for mount in mounts}
    free = [number for number in range(count) if number not in taken]
    unnamed = [name for name in bodies if name not in sheet.tags]
    if len(unnamed) > len(free):
        raise ModelError(f"tags: expected at most {len(free)} bodies without tags of their own, got {len(unnamed)}")
    given = {name: (TagMount(id=number, size=sheet.size),) for name, number in zip(unnamed, free, strict=False)}
    return {name: given.get(name) or sheet.tags[name] for name in bodies} | dict(sheet.tags)
