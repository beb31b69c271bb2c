"""Doors: what the force along a known path says of friction, catches, springs and play, by the angle of the hinge."""
