"""What the simulators' nodes share."""
