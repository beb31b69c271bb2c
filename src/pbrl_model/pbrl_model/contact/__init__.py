"""Learning of a body that was only touched by another one."""
