"""Object trajectories: timed planar poses, the file they come from, and what follows them."""
