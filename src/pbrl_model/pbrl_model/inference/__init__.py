"""Inference on any log density: modes, Metropolis, importance sampling with evidence, sequential Monte Carlo."""
