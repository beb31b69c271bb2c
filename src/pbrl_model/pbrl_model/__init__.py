"""The world model: pymunk world, compiled kernel, priors, likelihood, inference; model_node."""
