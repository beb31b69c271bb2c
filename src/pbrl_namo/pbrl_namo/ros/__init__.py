"""The node and what it is made of; the only part of this package that knows ROS."""
