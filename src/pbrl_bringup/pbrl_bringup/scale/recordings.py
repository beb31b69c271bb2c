"""Which recordings a command was given, and a folder's name for the results of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from glob import has_magic
from itertools import chain
from pathlib import Path

from pbrl_bag.metadata import FILE_NAME
from pbrl_bringup.errors import BringupError

FILES = (".mcap", ".db3")
"""Endings of the files that make a folder a bag."""
ALONE = ".bag"
"""Ending of a file that is a recording by itself wherever it lies (ROS 1)."""


@dataclass(frozen=True)
class Chosen:
    """Recordings in the order in which they were given.

    Attributes:
        bags: bag folders and files.
        several: whether they were asked for as several, be it that only one was found.
    """

    bags: tuple[Path, ...]
    several: bool


def choose_recordings(given: Sequence[Path], listed: Path | None) -> Chosen:
    """Return the recordings that arguments and a list name.

    Args:
        given: bags; folders with bags below them; patterns such as `runs/*/bag`.
        listed: a text file with a bag on each line; None: no such file.

    Raises:
        BringupError: none is named, one is not there or named twice, or the list cannot be read.
    """
    if not given and listed is None:
        raise BringupError("expected at least one bag, or --list FILE with a bag on each line, got neither")
    bags = [*chain(*map(_found, given)), *(_listed(listed) if listed is not None else ())]
    if not bags:
        raise BringupError(f"{listed}: expected a bag on each line, got none")
    if len(bags) > 1 and (missing := [path for path in bags if not path.exists()]):
        more = f", and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise BringupError(f"{missing[0]}: expected a recording, got nothing of that name{more}")
    [(twice, count)] = Counter(path.resolve() for path in bags).most_common(1)
    if count > 1:
        raise BringupError(f"{twice}: expected each recording once, got it {count} times; leave out what repeats it")
    return Chosen(tuple(bags), listed is not None or len(bags) > 1 or bags != list(given))


def folder_names(bags: Sequence[Path]) -> list[str]:
    """Return a name for each recording's results: its own, with its folder's in front where several have the same."""
    short = [path.resolve().with_suffix("").name if path.is_file() else path.resolve().name for path in bags]
    often = Counter(short)
    long = [
        f"{path.resolve().parent.name}_{name}" if often[name] > 1 else name
        for path, name in zip(bags, short, strict=True)
    ]
    # Where that does not tell them apart either they are numbered, past numbers that are names of others.
    names: list[str] = []
    often, taken = Counter(long), {name for name, count in Counter(long).items() if count == 1}
    for name in long:
        number, numbered = 1, name
        while often[name] > 1 and numbered in taken:
            number += 1
            numbered = f"{name}_{number}"
        taken.add(numbered)
        names.append(numbered)
    return names


def _found(path: Path) -> list[Path]:
    """Return the bag that an argument is, or those below it, or those that it describes."""
    try:
        there = path.exists()
    except OSError:
        return [path]  # a name that no file can have: who reads it says so
    if not there and has_magic(str(path)):
        anchor = Path(path.anchor) if path.is_absolute() else Path()
        found = sorted(anchor.glob(str(path.relative_to(path.anchor) if path.is_absolute() else path)))
        if not found:
            raise BringupError(f"{path}: expected a pattern that some recording has, got none")
        return found
    if path.is_dir() and not _is_bag(path):
        return _below(path) or [path]
    return [path]


def _below(folder: Path) -> list[Path]:
    found = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith("."):
            continue
        if path.is_dir():
            found += [path] if _is_bag(path) else _below(path)
        elif path.suffix.lower() == ALONE:
            found.append(path)
    return found


def _is_bag(folder: Path) -> bool:
    return (folder / FILE_NAME).exists() or any(path.suffix.lower() in FILES for path in folder.iterdir())


def _listed(path: Path) -> list[Path]:
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise BringupError(f"--list {path}: expected a text file with a bag on each line: {why}") from error
    return [Path(line.strip()) for line in lines if line.strip() and not line.lstrip().startswith("#")]
