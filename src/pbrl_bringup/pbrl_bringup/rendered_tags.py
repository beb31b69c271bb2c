"""The library that finds tags, as a reader of the simulator's pictures: what tag_detector_node is in a graph.

Runs without middleware use it. It is given what the node hears: pictures, what calibrations say, names of bodies.
"""

from __future__ import annotations

from collections.abc import Sequence

from bullet_sim.catalogue import Fixture
from bullet_sim.scene import Scene
from krang_sim.observations import CameraPicture, TagReading
from krang_sim.tag_cameras import ReadTags
from pbrl_bringup.paths import config_file
from pbrl_model.tags.calibration import calibration
from pbrl_model.tags.reader import Picture, TagReader
from pbrl_model.tags.sheet import load_tag_sheet, worn_tags


def reader_of(scene: Scene) -> ReadTags | None:
    """Return what finds tags in the pictures of a scene; None where the scene makes tags by their noise.

    Raises:
        ModelError: a sheet of tags that cannot be used.
    """
    if scene.sensors.tags.source != "rendered":
        return None
    return tag_reader([name for name, body in scene.bodies.items() if not isinstance(body, Fixture)])


def tag_reader(bodies: Sequence[str]) -> ReadTags:
    """Return what finds the tags of the workspace's sheet.

    Args:
        bodies: names of the movable bodies, in the order of the scene.

    Raises:
        ModelError: a sheet of tags that cannot be used.
    """
    sheet = load_tag_sheet(config_file("params", "tags"))
    reader = TagReader(sheet.dictionary, worn_tags(sheet, bodies))

    def read(pictures: Sequence[CameraPicture]) -> list[TagReading]:
        taken = pictures[0].time
        found = reader.read([as_picture(picture) for picture in pictures])
        return [TagReading(taken, each.name, each.position, each.quaternion) for each in found]

    return read


def as_picture(picture: CameraPicture) -> Picture:
    """Return a picture of the simulator as the library takes it."""
    lines, width = picture.image.shape
    camera = calibration(
        picture.frame, (width, lines), picture.matrix, picture.distortion, picture.position, picture.quaternion
    )
    return Picture(camera, picture.image)
