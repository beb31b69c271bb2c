"""ArviZ when it is first needed: its import takes seconds, which a node or a command should not wait for to start."""

from __future__ import annotations

import importlib
import warnings
from functools import cache
from typing import Any


@cache
def az() -> Any:
    """Return the module `arviz`, which is untyped, imported without its announcement."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)  # ArviZ announces its own successor at every import
        return importlib.import_module("arviz")
