"""How a command that failed ends: one line on stderr, and the exit code that says whose mistake it was."""

from __future__ import annotations

import os
import sys
import traceback
from pathlib import Path

# Errors whose message is for the person at the keyboard. Named, not imported: an error can only have
# been raised by a module that is loaded, and loading all of them would slow every start.
USER_ERRORS = {
    "pbrl_bag.errors": "BagError",
    "pbrl_model.errors": "ModelError",
    "pbrl_mismatch.errors": "MismatchError",
    "pbrl_control.errors": "ControlError",
    "pbrl_planner.errors": "PlannerError",
    "pbrl_namo.errors": "NamoError",
    "bullet_sim.errors": "SimError",
    "pbrl_bringup.errors": "BringupError",
}


LONGEST = 2000
"""Letters of a message."""


def complain(message: str, code: int) -> int:
    """Say what is wrong, and return the exit code."""
    print(f"pbrl: {message}", file=sys.stderr)
    return code


def complain_of(error: Exception) -> int:
    """Say what is wrong, and return 2 for something that the person can mend, 1 for a fault of ours."""
    return complain(told_of(error), 2 if is_for_the_user(error) else 1)


def told_of(error: Exception) -> str:
    """Return what a person is told of an error, in a line."""
    return _short(" ".join(str(error).split())) if is_for_the_user(error) else _fault(error)


def is_for_the_user(error: Exception) -> bool:
    """Tell whether an error is one of ours, whose message says what the person can mend."""
    return isinstance(error, errors_of_ours())


def errors_of_ours() -> tuple[type[Exception], ...]:
    """Return the classes of `USER_ERRORS` whose modules are loaded."""
    loaded = [(sys.modules[module], name) for module, name in USER_ERRORS.items() if module in sys.modules]
    return tuple(getattr(module, name) for module, name in loaded)


def _short(text: str) -> str:
    """Return a text that a terminal can show: what a file says can be of any length, and of any letters."""
    text = "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."


def _fault(error: Exception) -> str:
    """Describe an error that nobody foresaw; PBRL_TRACEBACK=1 shows where it comes from."""
    if os.environ.get("PBRL_TRACEBACK"):
        traceback.print_exception(error)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    what = " ".join(f"{type(error).__name__}: {error}".split())
    where = f"{Path(frame.filename).name}:{frame.lineno}"
    return f"a fault in pbrl at {where}, {what}; PBRL_TRACEBACK=1 shows more"
