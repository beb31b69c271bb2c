"""Errors of pbrl_bringup. Each message is one line: what was expected, what was got, what to do."""


class BringupError(Exception):
    """Something the person at the command line can mend; the message is one line."""
