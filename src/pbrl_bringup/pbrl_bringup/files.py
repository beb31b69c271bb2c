"""Writing whole files and folders: nothing half-written is ever seen under its final name."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pbrl_bringup.errors import BringupError


def write_text(path: Path, text: str) -> None:
    """Write a text file under another name first, then rename it."""
    temporary = _beside(path)
    try:
        temporary.write_text(text, encoding="utf-8")
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise BringupError(f"{path}: cannot be written: {error.strerror}; choose another --out") from error


def write_json(path: Path, value: Any) -> None:
    """Write strict JSON, whole or not at all; NaN becomes null."""
    write_text(path, json.dumps(without_nan(value), indent=2, allow_nan=False) + "\n")


def without_nan(value: Any) -> Any:
    """Return `value` with NaN and infinities, which JSON does not have, replaced by None."""
    if isinstance(value, dict):
        return {key: without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [without_nan(item) for item in value]
    if isinstance(value, float) and (value != value or value in (float("inf"), float("-inf"))):
        return None
    return value


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Yield a temporary folder beside `path` that takes its name if the block ends well.

    Raises:
        BringupError: `path` exists and is not an empty folder, or cannot be made.
    """
    refuse_existing(path)
    temporary = _beside(path)
    try:
        temporary.mkdir(parents=True)
    except OSError as error:
        raise BringupError(f"{path}: cannot be made: {error.strerror}; choose another --out") from error
    try:
        yield temporary
        if path.exists():
            path.rmdir()
        temporary.replace(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


@contextmanager
def removed_afterwards(folder: Path) -> Iterator[None]:
    """Remove a folder when the block ends, however it ends and however much of the folder was made."""
    try:
        yield
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def refuse_existing(path: Path) -> None:
    """Raise BringupError where `path` holds something that would be overwritten, or cannot be a name."""
    try:
        if path.is_dir() and not any(path.iterdir()) and path.name:
            return
        taken = path.exists()
    except OSError as error:
        raise BringupError(f"{_short(path)}: cannot be made: {error.strerror}; choose another --out") from error
    if taken:
        raise BringupError(f"{path}: expected a name that is free, but it exists; choose another --out or remove it")


def new_folder_place(path: Path) -> None:
    """Make the folder in which `path` is to be made, and see that it can be.

    Raises:
        BringupError: something is there, or no folder can be made in this place.
    """
    refuse_existing(path)
    with result_folder(path.parent, keep=True):
        _try_writing(path.parent, path)


def output_folder(path: Path) -> Path:
    """Make the folder for results, if need be, and return it.

    Raises:
        BringupError: it is a file or cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _no_folder(path, error) from error
    _try_writing(path, path)
    return path


@contextmanager
def result_folder(path: Path, *, keep: bool = False) -> Iterator[Path]:
    """Make the folder for results before the work begins; where the work fails, what was made for it goes again.

    Args:
        path: the folder.
        keep: leave it there even if the block fails.

    Raises:
        BringupError: it is a file, or cannot be made or written to.
    """
    try:
        made = [folder for folder in (path, *path.parents) if not folder.exists()]
    except OSError as error:
        raise _no_folder(path, error) from error
    try:
        yield output_folder(path)
    except BaseException:
        for folder in [] if keep else made:
            with suppress(OSError):
                folder.rmdir()  # only if it is empty
        raise


def remove_files(folder: Path, names: Iterable[str]) -> None:
    """Remove what an earlier run left under these names, so that what lies in a folder is of one run.

    Raises:
        BringupError: one of them cannot be removed.
    """
    for name in names:
        try:
            (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise BringupError(f"{folder / name}: cannot be removed: {error.strerror}; choose another --out") from error


def _try_writing(folder: Path, meant: Path) -> None:
    """Raise BringupError where nothing can be made in a folder."""
    probe = folder / f".pbrl.{os.getpid()}.part"
    try:
        probe.mkdir()
        probe.rmdir()
    except OSError as error:
        raise _no_folder(meant, error) from error


def _no_folder(path: Path, error: OSError) -> BringupError:
    return BringupError(f"{_short(path)}: expected a folder for results: {error.strerror}; choose another --out")


def _short(path: Path) -> str:
    text = str(path)
    return text if len(text) <= 120 else f"{text[:117]}..."


def _beside(path: Path) -> Path:
    return path.with_name(f".{path.name}.{os.getpid()}.part")
