"""Errors of pbrl_control. Each message is one line: what was expected, what was got, what to do."""


class ControlError(Exception):
    """A controller, a plan or a robot description cannot be used as given; the message is one line."""
