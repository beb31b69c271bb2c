"""From motions to a posterior: density, modes, samplers, held-out test."""
