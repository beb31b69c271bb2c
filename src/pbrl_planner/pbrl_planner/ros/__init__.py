"""The nodes and what they are made of; the only part of this package that knows ROS."""
