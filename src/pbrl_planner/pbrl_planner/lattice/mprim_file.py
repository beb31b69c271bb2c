"""SBPL's `.mprim` files of motion primitives, and ours: the same with an articulation.

An articulated file has two lines more in its head (`numberofarticulations: 3`, `articulations_rad: -0.5 0 0.5`), a line
`startarticulation_c: 1` after each `startangle_c`, and a fourth number in each end and each pose.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.primitives import REACH, Primitive, PrimitiveSet, closing_fault
from pbrl_planner.lattice.tokens import Tokens

MOST = 100_000
"""Primitives of a file."""
MOST_POSES = 10_000
"""Poses of one primitive."""


def read_primitives(path: Path | str) -> PrimitiveSet:
    """Read an `.mprim` file, packed with gzip if it ends in .gz.

    Raises:
        PlannerError: the file is not what it should be: file, line, what was expected and got.
    """
    return parse_primitives(Tokens.of_file(Path(path)))


def parse_primitives(tokens: Tokens) -> PrimitiveSet:
    """Read the words of such a file.

    Raises:
        PlannerError: as `read_primitives`.
    """
    tokens.key("resolution_m")
    resolution = tokens.number("resolution_m", 0.0, 100.0)
    tokens.key("numberofangles")
    headings = tokens.whole("numberofangles", 1, 256)
    articulations: tuple[float, ...] = (0.0,)
    articulated = tokens.peek() == "numberofarticulations:"
    if articulated:
        tokens.key("numberofarticulations")
        count = tokens.whole("numberofarticulations", 1, 64)
        tokens.key("articulations_rad")
        articulations = tuple(tokens.number("articulations_rad", -4.0, 4.0) for _ in range(count))
        if any(a >= b for a, b in pairwise(articulations)):
            raise tokens.refuse("ascending articulations", str(articulations))
    tokens.key("totalnumberofprimitives")
    total = tokens.whole("totalnumberofprimitives", 1, MOST)
    primitives = []
    for _ in range(total):
        primitive = _primitive(tokens, headings, len(articulations), articulated)
        fault = closing_fault(primitive, resolution, headings, articulations)
        if fault:
            raise PlannerError(f"{tokens.name}, primitive that ends in line {tokens.line}: {fault}")
        primitives.append(primitive)
    if tokens.peek() is not None:
        raise tokens.refuse(f"the end after {total} primitives", repr(tokens.peek()))
    return PrimitiveSet(resolution, headings, articulations, tuple(primitives))


def _primitive(tokens: Tokens, headings: int, articulations: int, articulated: bool) -> Primitive:
    tokens.key("primID")
    number = tokens.whole("primID", 0, MOST)
    tokens.key("startangle_c")
    heading = tokens.whole("startangle_c", 0, headings - 1)
    phi = 0
    if articulated:
        tokens.key("startarticulation_c")
        phi = tokens.whole("startarticulation_c", 0, articulations - 1)
    tokens.key("endpose_c")
    dx, dy = (tokens.whole(f"endpose_c {axis}", -REACH, REACH) for axis in "xy")
    # SBPL's own files go one past either end, and mean the heading modulo a turn.
    end_heading = tokens.whole("endpose_c heading", -headings, 2 * headings - 1) % headings
    end_phi = tokens.whole("endpose_c articulation", 0, articulations - 1) if articulated else 0
    tokens.key("additionalactioncostmult")
    multiplier = tokens.whole("additionalactioncostmult", 1, 10_000)
    tokens.key("intermediateposes")
    count = tokens.whole("intermediateposes", 2, MOST_POSES)
    names = ("x", "y", "heading", "articulation")[: 4 if articulated else 3]
    poses = [[tokens.number(f"pose's {name}") for name in names] + [0.0] * (4 - len(names)) for _ in range(count)]
    return Primitive((heading, phi), (dx, dy, end_heading, end_phi), np.array(poses), multiplier, str(number))


def write_primitives(primitives: PrimitiveSet, path: Path | str) -> None:
    """Write an `.mprim` file: SBPL's own form where there is no articulation. Poses have six digits.

    Raises:
        PlannerError: the file cannot be written.
    """
    articulated = primitives.articulations != (0.0,)
    lines = [f"resolution_m: {primitives.resolution:.6f}", f"numberofangles: {primitives.headings}"]
    if articulated:
        lines.append(f"numberofarticulations: {len(primitives.articulations)}")
        lines.append("articulations_rad: " + " ".join(f"{phi:.6f}" for phi in primitives.articulations))
    lines.append(f"totalnumberofprimitives: {len(primitives.primitives)}")
    numbers: dict[tuple[int, int], int] = {}
    width = 4 if articulated else 3
    for each in primitives.primitives:
        number = numbers.get(each.start, 0)
        numbers[each.start] = number + 1
        lines += [f"primID: {number}", f"startangle_c: {each.start[0]}"]
        lines += [f"startarticulation_c: {each.start[1]}"] if articulated else []
        lines.append("endpose_c: " + " ".join(str(value) for value in each.end[:width]))
        lines.append(f"additionalactioncostmult: {each.multiplier}")
        lines.append(f"intermediateposes: {len(each.poses)}")
        lines += [" ".join(f"{value:.6f}" for value in pose[:width]) for pose in each.poses]
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise PlannerError(f"{path}: expected a file that can be written, got {error}") from error
