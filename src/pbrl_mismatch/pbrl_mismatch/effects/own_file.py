"""Effects of one's own from a Python file, for whoever has no script to put them into."""

from __future__ import annotations

import runpy
from pathlib import Path

from pbrl_mismatch.effects.own import own_effects
from pbrl_mismatch.effects.registry import EFFECTS
from pbrl_mismatch.errors import MismatchError


def load_effects(path: Path) -> tuple[str, ...]:
    """Run a Python file that calls `register_effect`, and return the names of the effects that it added.

    Raises:
        MismatchError: there is no such file, it fails, or it adds none.
    """
    if not path.is_file():
        raise MismatchError(f"{path}: expected a Python file that calls register_effect, got no file of that name")
    before = dict(EFFECTS)
    try:
        runpy.run_path(str(path))
    except MismatchError as error:
        raise MismatchError(f"{path}: {error}") from None
    except (Exception, SystemExit) as error:
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise MismatchError(f"{path}: expected a file that runs to its end, got {said}") from None
    added = tuple(name for name in own_effects() if EFFECTS[name] is not before.get(name))
    if not added:
        raise MismatchError(f"{path}: expected a file that calls register_effect, got one that adds no effect")
    return added
