"""Nodes of a running graph killed and frozen on purpose, and what became of robot, mission and recording."""
