"""Status of a node in a sentence: on a topic, and in the log, when it changes."""

from __future__ import annotations

import re

from rclpy.node import Node
from std_msgs.msg import String

from pbrl_control.ros.qos import LATCHED

NOTHING_TO_CLEAR = "there was nothing to clear"
"""What a service that takes something out of the costmaps answers where there was nothing."""
NUMBERS = re.compile(r"[\d.]+")


class Saying:
    """Says what is new.

    Args:
        node: that says it.
        topic: std_msgs/String, for late subscribers, too.
        first: sentence.

    Attributes:
        sentence: the last one, with its numbers.
    """

    def __init__(self, node: Node, topic: str, first: str) -> None:
        self._node, self._said = node, ""
        self.sentence = ""
        self._out = node.create_publisher(String, topic, LATCHED)
        self(first)

    def is_new(self, sentence: str) -> bool:
        """Say whether a sentence differs from the last in more than its numbers: those change all the time."""
        return NUMBERS.sub("", sentence) != self._said

    def __call__(self, sentence: str) -> None:
        """Say a sentence, if it is new."""
        self.sentence = sentence
        if self.is_new(sentence):
            self._said = NUMBERS.sub("", sentence)
            self._out.publish(String(data=sentence))
            self._node.get_logger().info(sentence)
