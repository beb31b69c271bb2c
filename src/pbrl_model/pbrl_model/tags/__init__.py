"""From pictures of calibrated cameras to poses of what wears tags; the first of the sensors, before `sensing`."""

from pbrl_model.tags.calibration import CameraCalibration
from pbrl_model.tags.finder import SeenTag, TagFinder
from pbrl_model.tags.moments import MomentGrouper
from pbrl_model.tags.pose import BodyPose, View, solve_pose
from pbrl_model.tags.reader import BodyReading, Picture, TagReader
from pbrl_model.tags.sheet import TagMount, TagSheet, load_tag_sheet, worn_tags

__all__ = [
    "BodyPose",
    "BodyReading",
    "CameraCalibration",
    "MomentGrouper",
    "Picture",
    "SeenTag",
    "TagFinder",
    "TagMount",
    "TagReader",
    "TagSheet",
    "View",
    "load_tag_sheet",
    "solve_pose",
    "worn_tags",
]
