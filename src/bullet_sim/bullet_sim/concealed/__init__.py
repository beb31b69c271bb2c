"""What is true and not told: a file an effect, each built from the physics of the thing."""
