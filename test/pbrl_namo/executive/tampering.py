"""What befalls an office of fakes while a story goes on: something done once, tags that vanish or freeze."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from office_of_fakes import Office, light

from pbrl_namo.executive import Move, NamoExecutive, State
from pbrl_namo.executive.table import Event


def events(executive: NamoExecutive) -> list[Event]:
    return [change.event for change in executive.mission.account.log]


def once(world: Office, state: State, act: Callable[[], None], after: float = 0.0) -> None:
    """Do something once, so long after a state was entered for the first time."""
    since: list[float] = []

    def happens(world: Office) -> None:
        if world.states[-1] == state and not since:
            since.append(world.time)
        if since and world.time >= since[0] + after - 1e-9:
            world.happens = lambda world: None  # type: ignore[assignment,misc]
            act()

    world.happens = happens  # type: ignore[assignment]


def hide(world: Office, *names: str) -> None:
    world.tamper = lambda _, percept: replace(
        percept, tags={name: each for name, each in percept.tags.items() if name not in names}
    )


def freeze(world: Office, *names: str) -> None:
    """Show these tags as they are now for ever."""
    old = {name: world.percept().tags[name] for name in names}
    world.tamper = lambda _, percept: replace(percept, tags={**percept.tags, **old})


def known(move: Move) -> Move:
    """Return a move with a model of what is moved, as far as anybody knows."""
    return replace(move, model=light())
