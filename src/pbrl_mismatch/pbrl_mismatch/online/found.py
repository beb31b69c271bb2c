"""What has been found so far, object by object: alarms at once, diagnoses when they are ready."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pbrl_mismatch.online.diagnosing import Diagnosed
from pbrl_mismatch.online.monitor import Alarm


@dataclass(frozen=True)
class Found:
    """One object's entry of `/mismatches`.

    Attributes:
        alarm: that began it.
        diagnosed: of it, or None before it is ready.
    """

    alarm: Alarm
    diagnosed: Diagnosed | None = None

    @property
    def report(self) -> Mapping[str, Any]:
        """Return this object's part of `report.json`; empty before the diagnosis and where it failed."""
        return self.diagnosed.report if self.diagnosed is not None else {}

    @property
    def next_push(self) -> Mapping[str, Any] | None:
        """Return the push that would tell most, in the form of `report.json`; None where none would."""
        return self.diagnosed.next_push if self.diagnosed is not None else None

    @property
    def verdict(self) -> str:
        """Return it in a sentence."""
        return self.diagnosed.verdict if self.diagnosed is not None else self.alarm.verdict


class Findings:
    """The entries, in the order of their first alarms."""

    def __init__(self) -> None:
        self._entries: dict[str, Found] = {}

    def add_alarms(self, alarms: Sequence[Alarm]) -> None:
        """Take new alarms; a diagnosis that there is already is kept until there is a newer one."""
        for alarm in alarms:
            before = self._entries.get(alarm.object)
            self._entries[alarm.object] = Found(alarm, before.diagnosed if before else None)

    def add_diagnoses(self, found: Sequence[Diagnosed]) -> None:
        """Take diagnoses of objects with an alarm."""
        for one in found:
            if one.object in self._entries:
                self._entries[one.object] = replace(self._entries[one.object], diagnosed=one)

    def forget(self) -> None:
        """Begin anew: what was found was found on another clock."""
        self._entries.clear()

    @property
    def next_push(self) -> Mapping[str, Any] | None:
        """Return the push that would tell most of all, in the form of `report.json`."""
        pushes = [each.next_push for each in self.entries if each.next_push is not None]
        return max(pushes, key=lambda each: float(each["expected_bits"]), default=None)

    def alarm_of(self, name: str) -> Alarm | None:
        """Return the last alarm about an object."""
        return self._entries[name].alarm if name in self._entries else None

    @property
    def entries(self) -> tuple[Found, ...]:
        """Return what there is."""
        return tuple(self._entries.values())
