"""Where things are: the workspace, its configuration, its nodes."""

from __future__ import annotations

import difflib
import os
import re
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix, get_package_share_directory

from pbrl_bringup.errors import BringupError

_PROGRAM = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")


def workspace() -> Path:
    """Return the root of the workspace, where `./pbrl` and `test/` are.

    Raises:
        BringupError: the package is installed without its workspace.
    """
    root = os.environ.get("PBRL_ROOT")
    candidates = [Path(root)] if root else []
    candidates += Path(__file__).resolve().parents
    for folder in candidates:
        if (folder / "pbrl").is_file() and (folder / "pyproject.toml").is_file():
            return folder
    raise BringupError("expected to be run from a workspace with ./pbrl and pyproject.toml; start it with ./pbrl")


def config_file(kind: str, name: str, suffix: str = ".yaml") -> Path:
    """Return the file meant by `name`: a path that exists, or a name below `config/<kind>/`.

    Args:
        kind: folder below config, e.g. "scenes" or "params/graphs".
        name: "locked_caster", "locked_caster.yaml" or a path.
        suffix: what the files of this kind end with.

    Raises:
        BringupError: there is none; the message names the nearest known one.
    """
    given = Path(name)
    if given.suffix == suffix and given.is_file():
        return given
    folder = Path(get_package_share_directory("pbrl_config")) / kind
    found = folder / (given.stem + suffix)
    if found.is_file() and given.parent == Path():
        return found
    known = sorted(path.stem for path in folder.glob(f"*{suffix}"))
    near = difflib.get_close_matches(given.stem, known, 1)
    advice = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known) or 'none'}"
    what = kind.split("/")[-1].rstrip("s")
    raise BringupError(f"{name}: expected a {what} file or the name of one in config/{kind}; {advice}")


def node_executable(package: str, executable: str) -> Path:
    """Return the program of a node, found as `ros2 run PACKAGE EXECUTABLE` finds it.

    Raises:
        BringupError: the package is not in the ament index, or it has no such executable.
    """
    try:
        folder = Path(get_package_prefix(package)) / "lib" / package
    except ValueError as error:
        raise BringupError(f"package: expected a name of letters, digits, _ and -, got {package[:60]!r}") from error
    except PackageNotFoundError as error:
        raise BringupError(f"package {package!r} is not in the ament index; build the workspace with ./pbrl") from error
    path = folder / executable
    if not _PROGRAM.fullmatch(executable):  # a graph file starts programs of packages, and none from elsewhere
        raise BringupError(f"{package}: expected the name of an executable of its own, got {executable[:60]!r}")
    if not (path.is_file() and os.access(path, os.X_OK)):
        known = sorted(item.name for item in folder.glob("*") if os.access(item, os.X_OK))
        raise BringupError(f"{package} has no executable {executable!r}; it has {', '.join(known) or 'none'}")
    return path
