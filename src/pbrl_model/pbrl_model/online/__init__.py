"""Learning while a recording still comes in, and going on from it after a restart."""
