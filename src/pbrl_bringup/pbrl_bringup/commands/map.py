"""`./pbrl map BAG`: which stream of a foreign bag could play which role, and a mapping file to go on with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from pbrl_bag import read_recording
from pbrl_bag.errors import BagError
from pbrl_bag.proposing import mapping_text, propose
from pbrl_bag.proposing.text import completed
from pbrl_bringup.errors import BringupError
from pbrl_bringup.files import write_text
from pbrl_bringup.terminal import output, say, table


def command(bag: Path, out: Path, sizes: Sequence[str]) -> int:
    """Print proposals with reasons, and write a mapping file.

    Raises:
        BagError: the bag cannot be read.
        BringupError: the file is there already, or a size is none.
    """
    known = dict(_size(each) for each in sizes)
    proposal = propose(bag)
    rows = [(each.stream, each.role or "none", each.why) for each in proposal.streams]
    output().print(table(str(bag), ("stream", "role", "because"), rows))
    if proposal.mapping is None:
        say("pbrl: every topic has the name of the contract: no mapping is needed")
        return 0
    strangers = set(known) - set(proposal.mapping.object_poses)
    if strangers:
        there = ", ".join(proposal.mapping.object_poses) or "none"
        raise BringupError(f"--size: expected bodies among {there}, got {', '.join(sorted(strangers))}")
    if out.exists():
        raise BringupError(f"{out}: expected a file that is not there yet, got one; it may have been corrected by hand")
    write_text(out, mapping_text(proposal, str(bag), known))
    say(f"pbrl: written: {out}")
    if not completed(proposal.mapping, known):
        for each in proposal.left:
            say(f"pbrl: to do: {each}")
        return 0
    try:
        recording = read_recording(bag, out)
    except BagError as error:
        say(f"pbrl: to do: {error}")
        return 0
    for grasp in recording.grasps:
        say(f"pbrl: {grasp.gripper} holds {grasp.object} from {grasp.start:.2f} to {grasp.end:.2f} s")
    say(f"pbrl: next: ./pbrl fit {bag} --map {out}")
    return 0


def _size(text: str) -> tuple[str, tuple[float, float]]:
    """Read NAME=LENGTHxWIDTH."""
    name, _, sides = text.partition("=")
    try:
        length, width = (float(each) for each in sides.lower().split("x"))
    except ValueError:
        length = width = math.nan
    if not name or not (0.0 < length < math.inf and 0.0 < width < math.inf):
        raise BringupError(f"--size: expected NAME=LENGTHxWIDTH in metres, as table=1.2x0.8, got {text!r}")
    return name, (length, width)
