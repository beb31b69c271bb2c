"""Hypotheses held against the recorded path: quick, and no window can run away."""
