"""Lattice planner of thesis chapter 4: a robot, with or without a cart, among obstacles, in bounded suboptimality."""
