"""What a long bench has done, in one file that goes from machine to machine, beside the code that it was done with."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path, PurePosixPath
from typing import Any

from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_text


@dataclass(frozen=True)
class Carried:
    """What of a bench's results is carried.

    Attributes:
        files: patterns of the files that a case leaves when it is done, below the folder of results.
        packages: packages and modules that the cases measure: cases of other code are of another bench.
    """

    files: tuple[str, ...]
    packages: tuple[str, ...]

    def code(self) -> str:
        """Return a digest of the packages' modules, names and bytes.

        Raises:
            BringupError: there is no such package.
        """
        digest = hashlib.sha256()
        for package in self.packages:
            found = find_spec(package)
            if found is None or found.origin is None:
                raise BringupError(f"--carry: expected a package {package}, got none")
            whole = found.submodule_search_locations is not None
            paths = sorted(Path(found.origin).parent.rglob("*.py")) if whole else [Path(found.origin)]
            for path in paths:
                digest.update(f"{package}/{path.relative_to(Path(found.origin).parent).as_posix()}\n".encode())
                digest.update(path.read_bytes())
        return digest.hexdigest()[:16]

    def names(self, file: str) -> bool:
        """Tell whether a path below the folder of results is one of such a file, and stays below it."""
        inside = not PurePosixPath(file).is_absolute() and ".." not in PurePosixPath(file).parts
        return inside and any(fnmatchcase(file, pattern) for pattern in self.files)


def carry_in(path: Path, folder: Path, told: dict[str, Any], carried: Carried) -> int:
    """Lay what a file carries into a folder of results, unless it is there, and return how many files that were.

    Args:
        path: of the file; none yet: nothing is carried.
        folder: of results.
        told: what the cases are of, name and seed.
        carried: of the bench.

    Raises:
        BringupError: it is no such file, or of another bench, seed or code.
    """
    if not path.exists():
        return 0
    try:
        head, *rest = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
        files = {str(each["file"]): str(each["text"]) for each in rest}
        of = dict(head)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BringupError(f"--carry {path}: expected a file that a bench wrote, got something else") from error
    expected = told | {"code": carried.code()}
    for key, value in expected.items():
        if of.get(key) != value:
            raise BringupError(
                f"--carry {path}: expected cases of {key} {value!r}, got {of.get(key)!r}; choose another file"
            )
    for file, text in files.items():
        if not carried.names(file):
            raise BringupError(f"--carry {path}: expected files like {', '.join(carried.files)}, got {file!r}")
        if not (folder / file).exists():
            (folder / file).parent.mkdir(parents=True, exist_ok=True)
            write_text(folder / file, text)
    return len(files)


def carry_out(path: Path, folder: Path, told: dict[str, Any], carried: Carried) -> None:
    """Write into one file what there is in a folder of results, a line each; see `carry_in`."""
    files = sorted(each for pattern in carried.files for each in folder.glob(pattern))
    lines = [json.dumps(told | {"code": carried.code()})]
    lines += [
        json.dumps({"file": each.relative_to(folder).as_posix(), "text": each.read_text(encoding="utf-8")})
        for each in files
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, "\n".join(lines) + "\n")
