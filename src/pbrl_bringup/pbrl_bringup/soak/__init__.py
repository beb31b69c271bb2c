"""A graph that runs for an hour in one room after another, and what is watched of it."""
