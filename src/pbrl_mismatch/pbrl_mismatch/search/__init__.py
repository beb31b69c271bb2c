"""Hypotheses fitted, weighed and tested."""
