"""Errors of pbrl_namo. Each message is one line: what was expected, what was got, what to do."""


class NamoError(Exception):
    """A scene, a belief or a setting cannot be planned with as given; the message is one line."""
