"""Words of a text file that somebody else wrote, one after the other, and the line that each is in."""

from __future__ import annotations

import gzip
import math
import zlib
from pathlib import Path

from pbrl_planner.errors import PlannerError

LARGEST = 256 * 2**20
"""[bytes] of a text file, unpacked."""


class Tokens:
    """Reads `key: value` texts as SBPL writes them: line breaks count as blanks.

    Args:
        text: of the file.
        name: of the file, for messages.
    """

    def __init__(self, text: str, name: str) -> None:
        self.name = name
        self.lines = text.splitlines()
        self.line = 0
        self._words: list[str] = []
        self._place = 0

    @classmethod
    def of_file(cls, path: Path) -> Tokens:
        """Read a file, unpacked if it ends in .gz.

        Raises:
            PlannerError: it cannot be read, is no text, or larger than 256 MiB.
        """
        try:
            with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
                data = file.read(LARGEST + 1)
            if len(data) > LARGEST:
                raise PlannerError(f"{path}: expected at most {LARGEST >> 20} MiB of text, got more")
            return cls(data.decode("utf-8"), str(path))
        except (OSError, EOFError, zlib.error, UnicodeDecodeError) as error:
            raise PlannerError(f"{path}: expected a readable text file, got {error}") from error

    def refuse(self, expected: str, got: str) -> PlannerError:
        """Return the error that names file, line, what was expected and what was got."""
        return PlannerError(f"{self.name}, line {max(self.line, 1)}: expected {expected}, got {got[:60]}")

    def next(self, expected: str) -> str:
        """Return the next word.

        Raises:
            PlannerError: there is none.
        """
        word = self.peek()
        if word is None:
            raise self.refuse(expected, "the end of the file")
        self._place += 1
        return word

    def peek(self) -> str | None:
        """Return the next word and leave it there; None at the end."""
        while self._place >= len(self._words):
            if self.line >= len(self.lines):
                return None
            self._words, self._place = self.lines[self.line].split(), 0
            self.line += 1
        return self._words[self._place]

    def key(self, name: str) -> None:
        """Step over `name:`.

        Raises:
            PlannerError: something else stands there.
        """
        word = self.next(f"{name}:")
        if word != f"{name}:":
            raise self.refuse(f"{name}:", repr(word))

    def whole(self, what: str, low: int, high: int) -> int:
        """Return a whole number from `low` to `high`.

        Raises:
            PlannerError: it is none, or out of that range.
        """
        expected = f"{what}: a whole number from {low} to {high}"
        word = self.next(expected)
        try:
            value = int(word) if len(word) <= 20 else None
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise self.refuse(expected, repr(word))
        return value

    def number(self, what: str, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number above `low`, at most `high`.

        Raises:
            PlannerError: it is none, or out of that range.
        """
        limits = "" if math.isinf(low) and math.isinf(high) else f" above {low:g}, at most {high:g}"
        expected = f"{what}: a finite number{limits}"
        word = self.next(expected)
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not (math.isfinite(value) and low < value <= high):
            raise self.refuse(expected, repr(word))
        return value

    def rest(self) -> tuple[list[str], int]:
        """Return the lines that follow, what is left of this one first, and this one's number."""
        begin = self.line
        lines = [" ".join(self._words[self._place :]), *self.lines[self.line :]]
        self.line, self._words, self._place = len(self.lines), [], 0
        return lines, max(begin, 1)
