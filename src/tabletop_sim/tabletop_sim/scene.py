"""A desk: a table, what stands on it, where the arm stands, and the camera over it.

Files are `config/desks/*.yaml`; a fault in one is a `SimError` naming file, key and remedy. `world` is in the middle of
the table, z = 0 its top.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal, Self

from ament_index_python.packages import PackageNotFoundError, get_package_share_directory
from pydantic import Field, model_validator
from shapely import Polygon, box
from shapely.affinity import rotate, translate

from bullet_sim.camera_settings import CameraSettings
from bullet_sim.errors import SimError, nearest
from bullet_sim.faults import Faults
from bullet_sim.settings import NonNegative, Settings, Vector3, read_settings
from tabletop_sim.catalogue import DeskItem

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
Vision = Literal["rendered", "noise"]


class TableSettings(Settings):
    """The table.

    Attributes:
        length: along x [m].
        width: along y [m].
    """

    length: Annotated[float, Field(ge=0.2, le=3.0)] = 0.8
    width: Annotated[float, Field(ge=0.2, le=3.0)] = 0.5


class VisionSettings(Settings):
    """How items are seen.

    Attributes:
        source: rendered: pictures are given out, and somebody finds the items in them; noise: poses are given out.
        rate: of pictures or poses [Hz].
        camera: that hangs over the middle of the table; heights are over its top.
        sigma_xy: noise of a pose [m].
        sigma_yaw: [rad].
    """

    source: Vision = "rendered"
    rate: Annotated[float, Field(gt=0.0, le=60.0)] = 2.0
    camera: CameraSettings = CameraSettings(
        grid=(1, 1), height=2.0, width=800, lines=600, field_of_view=0.49, oversampling=1, whole=True
    )
    sigma_xy: NonNegative = 0.001
    sigma_yaw: NonNegative = 0.01

    @model_validator(mode="after")
    def _one_whole_camera(self) -> Self:
        if self.camera.grid != (1, 1) or not self.camera.whole:
            raise ValueError("camera: expected grid [1, 1] and whole pictures: one camera sees all of the table")
        return self


class DeskScene(Settings):
    """One desk.

    Attributes:
        name: in words.
        table: its size.
        items: what stands on it, by name.
        arm: (x, y, theta) of the arm's column [m, rad].
        vision: how items are seen.
        faults: links and clocks that fail on purpose.
    """

    name: str = "desk"
    table: TableSettings = TableSettings()
    items: dict[str, DeskItem] = Field(min_length=1)
    arm: Vector3 = (0.0, -0.45, 1.5707963267948966)
    vision: VisionSettings = VisionSettings()
    faults: Faults = Faults()

    @model_validator(mode="after")
    def _stand_apart(self) -> Self:
        top = box(-self.table.length / 2, -self.table.width / 2, self.table.length / 2, self.table.width / 2)
        seen: dict[str, Polygon] = {}
        for name, item in self.items.items():
            if not NAME.fullmatch(name):
                raise ValueError(f"items: expected a name of letters, digits and underscores, got {name[:60]!r}")
            outline = outline_of(item)
            if not top.covers(outline):
                raise ValueError(f"items.{name}: expected it wholly on the table, got pose {list(item.pose)}")
            for other, known in seen.items():
                if outline.intersection(known).area > 1e-7:
                    raise ValueError(f"items.{name}: expected it apart from {other}, they overlap; move one of them")
            seen[name] = outline
        return self


def outline_of(item: DeskItem) -> Polygon:
    """Return what an item covers of the table."""
    half_length, half_width = item.length / 2, item.width / 2
    x, y, theta = item.pose
    shape = box(-half_length, -half_width, half_length, half_width)
    return translate(rotate(shape, theta, origin=(0, 0), use_radians=True), x, y)


def load_desk(path: str | Path) -> DeskScene:
    """Read a desk.

    Args:
        path: a YAML file, or the bare name of a desk that comes with the workspace.

    Raises:
        SimError: no such desk, or a fault in it; one line naming file, key and nearest known key.
    """
    file = Path(path)
    if file.suffix not in (".yaml", ".yml") and not file.exists():
        known = {each.stem: each for each in desk_folder().glob("*.yaml")}
        if str(path) not in known:
            raise SimError(f"desk {str(path)!r}: expected a file or the name of a desk; {nearest(str(path), known)}")
        file = known[str(path)]
    scene = read_settings(file, DeskScene)
    return scene if "name" in scene.model_fields_set else scene.model_copy(update={"name": file.stem})


def desk_folder() -> Path:
    """Give the folder of the desks that come with the workspace; raise SimError where it is not built."""
    try:
        return Path(get_package_share_directory("pbrl_config")) / "desks"
    except PackageNotFoundError as error:
        raise SimError("desks: expected the package pbrl_config, found none; build and source the workspace") from error
