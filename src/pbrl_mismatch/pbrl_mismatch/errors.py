"""Errors of pbrl_mismatch. Each message is one line: what was expected, what was got, what to do."""

from __future__ import annotations


class MismatchError(Exception):
    """A recording or an option cannot be used for a diagnosis; the message says why in one line."""
