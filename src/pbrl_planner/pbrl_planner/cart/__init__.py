"""The planner of a robot with a cart, as a drive calls it: outlines, room around things, an account of each call."""
