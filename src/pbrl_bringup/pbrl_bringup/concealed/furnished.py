"""The furnished stage: a table on real casters, which is pushed once with nothing concealed, to learn what it is like.

Casters that trail and roll are effects to a model of plain feet. A diagnosis of the bare recording repairs the model
for them; with that model as its baseline, another is asked what was concealed on top.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bullet_sim.catalogue import OnCasters
from bullet_sim.errors import SimError
from bullet_sim.hand_push import push_by_hand
from bullet_sim.scene import Scene
from pbrl_bag.types import Recording
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, SLIPPED, Stage, draw_stage
from pbrl_bringup.errors import BringupError

TRIES = 8
"""Tables that are drawn before a case counts as one that cannot be made."""
SCRUB_LENGTH = 0.01
"""A tread that rolls while it turns is twisted less, see `bullet_sim.catalogue.CasterSettings` [m]."""
PART_OF_IT = ("caster_swivel", "ground_friction")
"""Effects that casters have of their own: they are not concealed on top."""
OF_CASTERS = (*PART_OF_IT, "breakaway_friction", "viscous_drag")
"""Effects that somebody who sees casters would repair a model with."""


def draw_furnished(rng: np.random.Generator) -> Stage:
    """Draw a table on casters, and pushes that it survives.

    Args:
        rng: source of randomness.

    Raises:
        BringupError: none of the tables drawn can be pushed.
    """
    why = ""
    for _ in range(TRIES):
        plain = draw_stage(rng)
        kept = {key: plain.table[key] for key in ("size", "nominal_mass", "pose")}
        told = plain.table.get("height", 0.7775)
        table = {**kept, "kind": "office_table", "height": told, "casters": {"scrub_length": SCRUB_LENGTH}}
        scene = {**plain.scene, "bodies": {NAME: table}}
        try:
            found = push_by_hand(Scene.model_validate(scene), plain.pushes, seed=plain.seed)
        except (SimError, ValueError) as error:
            why = str(error).splitlines()[-1]
            continue
        if found.status == "done" and found.slipped <= SLIPPED:
            return Stage(scene, plain.pushes, plain.seed, found.bodies[NAME], found)
        why = found.status if found.status != "done" else "it slips in the hand"
    raise BringupError(f"furnished: expected one of {TRIES} tables on casters to be pushed, got {why!r} in the last")


def bare_recording(stage: Stage) -> Recording:
    """Record a stage's table with nothing concealed: its pushes, the last one first, or in their order if that fails.

    Args:
        stage: furnished.

    Raises:
        BringupError: the pushes cannot be done.
    """
    scene, why = stage.with_concealed({}), ""
    for pushes in (stage.pushes[::-1], stage.pushes):
        try:
            found = push_by_hand(scene, pushes, seed=stage.seed + 1)
        except SimError as error:
            why = str(error)
            continue
        if found.status == "done":
            return with_casters(to_recording(found, scene), stage)
        why = found.status
    raise BringupError(f"furnished: expected the bare table's pushes to be done, got {why!r}")


def with_casters(recording: Recording, stage: Stage) -> Recording:
    """Return a recording that tells where the casters are: anybody can see them."""
    body = stage.with_concealed({}).bodies[NAME]
    if not isinstance(body, OnCasters):
        return recording
    swivels = np.array(list(body.swivels.values()), dtype=float)
    return replace(recording, bodies={**recording.bodies, NAME: replace(recording.bodies[NAME], casters=swivels)})
