"""CSV recordings: columns named by a mapping become the samples of streams."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from pbrl_bag.builder import RecordingBuilder
from pbrl_bag.errors import BagError
from pbrl_bag.mapping import Column, Mapping, PoseSource, TimeColumn, WrenchSource
from pbrl_bag.types import Array, Recording
from pbrl_bag.validation import nearest

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


class Table:
    """The cells of a CSV file, turned to numbers column by column.

    Args:
        path: the file; its first row names the columns.
        delimiter: one character between cells.

    Raises:
        BagError: missing, empty, no text, or a row of the wrong length.
    """

    def __init__(self, path: Path, delimiter: str):
        self.path = path
        try:
            with path.open(newline="", encoding="utf-8-sig") as file:
                rows = [(line, row) for line, row in enumerate(csv.reader(file, delimiter=delimiter), 1) if row]
        except OSError as error:
            raise BagError(f"{path}: expected a CSV file, {error.strerror or error}") from error
        except (UnicodeDecodeError, csv.Error) as error:
            raise BagError(f"{path}: expected CSV text in UTF-8, got: {error}") from error
        if not rows:
            raise BagError(f"{path}: expected a row of column names and rows of numbers, got an empty file")
        self.names = [name.strip() for name in rows[0][1]]
        self.rows = rows[1:]
        self._check()

    def _check(self) -> None:
        if len(set(self.names)) != len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise BagError(f"{self.path}: line 1: column {twice!r} is there twice; rename one")
        if len(self.rows) < 2:
            raise BagError(f"{self.path}: expected at least 2 rows of numbers, got {len(self.rows)}: zero length")
        for line, row in self.rows:
            if len(row) != len(self.names):
                raise BagError(
                    f"{self.path}: line {line}: expected {len(self.names)} cells, got {len(row)}; mend the line, or "
                    "say in the mapping which `delimiter` is between cells"
                )

    def column(self, name: str) -> Array:
        """Return a column (n,).

        Raises:
            BagError: no column of that name, or a cell that is not a finite number.
        """
        if name not in self.names:
            raise BagError(f"{self.path}: line 1: expected column {name!r}, got none; {nearest(name, self.names)}")
        k = self.names.index(name)
        values = np.empty(len(self.rows))
        for i, (line, row) in enumerate(self.rows):
            try:
                values[i] = float(row[k])
            except ValueError:
                values[i] = np.nan
            if not np.isfinite(values[i]):
                raise BagError(
                    f"{self.path}: line {line}: {name}: expected a finite number, got {row[k]!r}; "
                    "cut the recording around it"
                )
        return values

    def columns(self, names: tuple[Column, ...]) -> Array:
        """Return columns (n, k); a number in place of a name is a constant."""
        n = len(self.rows)
        return np.column_stack(
            [self.column(name) if isinstance(name, str) else np.full(n, float(name)) for name in names]
        )


def read_csv(path: Path, mapping: Mapping, *, complete: bool = True) -> Recording:
    """Read a CSV file through a mapping.

    Args:
        path: the file.
        mapping: names its columns.
        complete: see `RecordingBuilder.build`.

    Raises:
        BagError: the mapping does not fit the file, or the file is malformed.
    """
    if mapping.time is None:
        raise BagError(f"{path}: expected `time` in the mapping (column and unit), got none: a CSV file needs it")
    table = Table(path, mapping.delimiter)
    time = _time(table, mapping.time)
    if mapping.joint_efforts:
        raise BagError(f"{path}: joint_efforts: expected a bag, got a CSV file; give forces under `wrenches`")
    builder = RecordingBuilder(mapping)
    for name, pose in mapping.object_poses.items():
        _add_pose(builder, table, time, "object_poses", name, pose)
    for side, pose in mapping.gripper_poses.items():
        _add_pose(builder, table, time, "gripper_poses", side, pose)
    for side, wrench in mapping.wrenches.items():
        _add_wrench(builder, table, time, side, wrench)
    return builder.build(path, complete=complete)


def _time(table: Table, source: TimeColumn) -> Array:
    """Return the time column (n,) [s].

    Raises:
        BagError: it does not increase from row to row.
    """
    time = table.column(source.column) * SECONDS[source.unit]
    step = np.diff(time)
    if (step <= 0).any():
        i = int(np.argmax(step <= 0))
        what = "stands still" if step[i] == 0 else f"goes backwards by {-step[i]:.6f} s"
        raise BagError(
            f"{table.path}: line {table.rows[i + 1][0]}: {source.column}: time {what} at t = {time[i + 1]:.6f} s; "
            "expected it to increase from row to row; cut the recording there"
        )
    return time


def _add_pose(builder: RecordingBuilder, table: Table, time: Array, kind: str, name: str, source: PoseSource) -> None:
    """Add the columns of one pose to a builder."""
    if source.position is None:
        raise BagError(
            f"{table.path}: {kind}.{name}: names topic {source.topic!r}, but this is a CSV file; give `position`"
        )
    position = table.columns(source.position)
    quaternion = np.full((len(time), 4), np.nan)
    orientation, yaw = (None, None) if source.ignore_orientation else (source.orientation, source.yaw)
    if orientation is not None:
        quaternion = table.columns(orientation)
    elif yaw is not None:
        angle = table.columns((yaw,))[:, 0]
        angle = np.deg2rad(angle) if source.angle_unit == "deg" else angle
        zero = np.zeros_like(angle)
        quaternion = np.column_stack([zero, zero, np.sin(angle / 2.0), np.cos(angle / 2.0)])
    rows = np.column_stack([time, position, quaternion])
    label = f"{table.path}: {kind}.{name}"
    samples = builder.samples("object_poses" if kind == "object_poses" else "gripper_poses", name, label, source)
    samples.extend(rows)


def _add_wrench(builder: RecordingBuilder, table: Table, time: Array, side: str, source: WrenchSource) -> None:
    """Add the columns of one wrench to a builder."""
    if source.force is None:
        raise BagError(
            f"{table.path}: wrenches.{side}: names topic {source.topic!r}, but this is a CSV file; give `force`"
        )
    force = table.columns(source.force)
    felt = None if source.ignore_torque else source.torque
    torque = np.full_like(force, np.nan) if felt is None else table.columns(felt)
    rows = np.column_stack([time, force, torque])
    samples = builder.samples("wrenches", side, f"{table.path}: wrenches.{side}", source)
    samples.extend(rows)
