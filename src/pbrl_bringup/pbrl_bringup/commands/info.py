"""`./pbrl info BAG`: what a recording holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from pbrl_bag import Episode, Recording, cut_episodes, describe, read_recording
from pbrl_bringup.terminal import output, say, table


def command(bag: Path, mapping: Path | None) -> int:
    """Print topics with their rates, then objects, grasps and episodes.

    Raises:
        BagError: it cannot be read, or something in it is malformed.
    """
    if bag.suffix.lower() != ".csv":
        _print_topics(bag)
    recording = read_recording(bag, mapping)
    _print_recording(recording, cut_episodes(recording))
    for note in recording.notes:
        say(f"pbrl: {note}")
    return 0


def _print_topics(bag: Path) -> None:
    info = describe(bag)
    rows = [
        (
            topic.name,
            topic.type,
            str(topic.count),
            "" if math.isnan(topic.rate) else f"{topic.rate:.1f} Hz",
            f"{topic.longest_gap:.2f} s" if len(topic.gaps) else "",
        )
        for topic in info.topics
    ]
    state = "" if info.finished else ", not finished"
    title = f"{bag}: {info.message_count} messages, {info.duration:.1f} s, {info.size / 1e6:.1f} MB{state}"
    output().print(table(title, ("topic", "type", "messages", "rate", "longest gap"), rows, right=(2, 3, 4)))


def _print_recording(recording: Recording, episodes: Sequence[Episode]) -> None:
    bodies = [
        (
            body.name,
            f"{body.nominal_mass:g} kg" if math.isfinite(body.nominal_mass) else "",
            "yes" if body.movable else "no",
            str(len(recording.object_poses[body.name].time)) if body.name in recording.object_poses else "none",
        )
        for body in recording.bodies.values()
    ]
    output().print()
    output().print(table("bodies", ("name", "nominal mass", "movable", "poses"), bodies, right=(1, 3)))
    rows = [
        (each.object, " and ".join(each.grippers), f"{each.start:.2f} s", f"{each.end:.2f} s", f"{each.duration:.2f} s")
        for each in episodes
    ]
    output().print()
    output().print(table("episodes", ("object", "held by", "from", "to", "length"), rows, right=(2, 3, 4)))
