"""A tabletop without middleware: the simulated desk, its camera and its arm, taught and tidied in one process."""
