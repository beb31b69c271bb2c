"""Errors of pbrl_bag. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations


class BagError(Exception):
    """A recording, mapping or bag that cannot be used as it is.

    Attributes:
        message: one line, ready for a user.
    """

    def __init__(self, message: str):
        self.message = " ".join(message.split())
        super().__init__(self.message)
