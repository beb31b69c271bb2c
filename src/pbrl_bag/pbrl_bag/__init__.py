"""Recordings: the MCAP contract, bags in and out, episodes; recorder and player nodes."""

from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.episodes import Episode, cut_episodes
from pbrl_bag.errors import BagError
from pbrl_bag.info import BagInfo, TopicInfo, describe
from pbrl_bag.mapping import Mapping, load_mapping
from pbrl_bag.qos import Qos
from pbrl_bag.reader import read_recording
from pbrl_bag.recording_writer import write_recording
from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_bag.writer import BagWriter

__all__ = [
    "BagError",
    "BagInfo",
    "BagWriter",
    "BodyGeometry",
    "Episode",
    "Grasp",
    "Mapping",
    "PoseStream",
    "Qos",
    "Recording",
    "RecordingBuilder",
    "TopicInfo",
    "WrenchStream",
    "cut_episodes",
    "describe",
    "load_mapping",
    "read_recording",
    "write_recording",
]
