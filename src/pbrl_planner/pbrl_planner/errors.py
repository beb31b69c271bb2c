"""Errors of pbrl_planner. Each message is one line: what was expected, what was got, what to do."""


class PlannerError(Exception):
    """A problem cannot be planned as given; the message is one line."""
