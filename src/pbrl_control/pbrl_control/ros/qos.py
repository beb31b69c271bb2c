"""Qualities of service of the topic table."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)  # streams: only the last sample counts
COMMANDS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
