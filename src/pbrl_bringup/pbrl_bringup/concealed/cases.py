"""One concealed case: drawn from its seed, simulated, and split into the recording and the sealed truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bullet_sim.errors import SimError
from bullet_sim.hand_recording import Activity, HandRecording
from pbrl_bag.types import Recording
from pbrl_bringup.concealed.draws import DRAWS
from pbrl_bringup.concealed.oracle import Oracle, lay_out, seen
from pbrl_bringup.concealed.recording import to_recording
from pbrl_bringup.concealed.stage import NAME, Stage, draw_stage, play, saturated
from pbrl_bringup.concealed.told import told_values
from pbrl_bringup.concealed.truth import Truth
from pbrl_bringup.errors import BringupError
from pbrl_mismatch.search.told_baseline import ToldBaseline

TRIES = 8
"""Draws of an effect before a case counts as one that cannot be made."""
LEAST_SHARE = 0.02
"""Of the time in which the table moves: an effect that acts for less is drawn again."""
LEAST_MOVING = 0.25
"""Share of the time that a table has to move."""
LEAST_OFFSET = 1e-6
"""A sensor's offset that has changed by less [N, N m] is the same."""
FIRST_POSES = 5
"""Poses of the gripper from which its turn against the body is taken."""
PLACES = {"floor_patch": "polygon", "hidden_obstacle": "polygon", "second_wheel": "position", "hidden_hinge": "point"}
"""Settings that say where an effect is."""


@dataclass(frozen=True)
class Case:
    """What is to be concealed, and the seed of everything random.

    Attributes:
        effects: names; empty: a clean recording.
        seed: of the case.
    """

    effects: tuple[str, ...]
    seed: int

    @property
    def name(self) -> str:
        """Return what to call it."""
        return f"{'+'.join(self.effects) or 'clean'}-{self.seed}"


Learn = Callable[[Stage], ToldBaseline]


@dataclass(frozen=True)
class Made:
    """What the simulation of a case gave: the recording, the truth, and what a told oracle makes of it, if asked."""

    recording: Recording
    truth: Truth
    oracle: Oracle | None = None


def make(case: Case, draw: Callable[[np.random.Generator], Stage] = draw_stage, learn: Learn | None = None) -> Made:
    """Simulate a case; the same case makes the same recording.

    Args:
        case: what to conceal.
        draw: of the stage.
        learn: what is learned of the stage's table before anything is concealed; None: nothing.

    Raises:
        BringupError: no draw of the effects leads to a recording in which they act.
    """
    rng = np.random.default_rng([case.seed, *(sum(map(ord, name)) for name in case.effects)])
    stage = draw(rng)
    baseline = None if learn is None else learn(stage)
    why = ""
    least = 0.0
    for _ in range(TRIES):
        strength = float(rng.uniform(least, 1.0))
        concealed: dict[str, Any] = {}
        for effect in case.effects:
            concealed |= DRAWS[effect](rng, stage, strength)
        try:
            made = play(stage, concealed)
        except (SimError, ValueError) as error:
            why = str(error).splitlines()[-1]
            continue
        truth = _truth(case, stage, concealed, made, strength)
        why = _spoilt(made, truth)
        if why:
            continue
        recording = to_recording(made, stage.with_concealed(concealed))
        if not case.effects:
            return Made(recording, truth)
        found = seen(lay_out(recording, NAME, baseline), truth)
        if found is not None:
            return Made(recording, truth, found)
        why, least = "an effect too weak for an oracle that is told", strength
    raise BringupError(f"{case.name}: expected one of {TRIES} draws to act and to be done, got {why} in the last")


def _spoilt(made: HandRecording, truth: Truth) -> str:
    """Say why a recording does not count, or nothing."""
    if made.status != "done":
        return made.status
    if saturated(made):
        return "a wrist sensor at its end"
    if moves(made).mean() < LEAST_MOVING:
        return f"a table that moves in {100.0 * moves(made).mean():.0f} % of the time"
    return f"acting shares {truth.share}" if min(truth.share.values(), default=1.0) < LEAST_SHARE else ""


def moves(made: HandRecording) -> NDArray[np.bool_]:
    """Return (n,) when the table moves, at the rate of the simulator's truth."""
    twist = made.bodies[NAME].twist
    return np.asarray(np.hypot(*twist[:, :2].T) + 0.5 * np.abs(twist[:, 2]) > 0.02)


def _truth(case: Case, stage: Stage, concealed: dict[str, Any], made: HandRecording, strength: float) -> Truth:
    """Put the truth together; when an effect acts comes from the simulator."""
    moving = moves(made)
    when, share, place = {}, {}, {}
    for effect in case.effects:
        acts = [activity for activity in made.activities.values() if activity.effect == effect]
        acting = np.logical_or.reduce([activity.acting for activity in acts]) if acts else np.zeros_like(moving)
        if effect == "wrench_bias":
            acting &= np.logical_or.reduce([not_read_away(made, activity) for activity in acts])
        joined = Activity(effect, NAME, "", made.bodies[NAME].time, acting, np.zeros(len(acting)))
        when[effect] = [(float(start), float(end)) for start, end in joined.intervals()]
        share[effect] = float(acting[moving].mean()) if moving.any() else 0.0
        place[effect] = _place(effect, concealed[effect])
    told = told_values(concealed, stage.with_concealed(concealed), grip_turn(made))
    return Truth(case.effects, NAME, concealed, when, place, strength, share, told)


def not_read_away(made: HandRecording, offset: Activity) -> NDArray[np.bool_]:
    """Return (n,) when a sensor's offset is another than it was when the sensor was last read before a grasp.

    What it had then is taken out of the recording with the gripper's weight: it makes no difference to anything.
    """
    taken = np.array([change.time for change in made.grasps if change.body is not None])
    read = np.concatenate([[0.0], np.interp(taken, offset.time, offset.strength)])
    return np.asarray(np.abs(offset.strength - read[np.searchsorted(taken, offset.time, side="right")]) > LEAST_OFFSET)


def grip_turn(made: HandRecording) -> float:
    """Return the turn of the wrist sensor's axes against the body's when it was first held [rad]."""
    tag, track = made.tags[f"{made.side}_gripper"], made.bodies[NAME]
    began = next(change.time for change in made.grasps if change.body is not None)
    early = np.flatnonzero(tag.time >= began)[:FIRST_POSES]
    turn = 2.0 * np.arctan2(tag.quaternion[early, 2], tag.quaternion[early, 3])
    off = turn - np.interp(tag.time[early], track.time, track.pose[:, 2])
    return float(np.angle(np.mean(np.exp(1j * off))))


def _place(effect: str, settings: Any) -> list[tuple[float, float]]:
    """Return corners or a point of an effect that has a place, empty else; those of the body are in its own frame."""
    told = settings[0] if isinstance(settings, list) else settings.get(NAME)
    if effect == "tether":
        return [(float(told["anchor"][0]), float(told["anchor"][1]))]
    if effect not in PLACES or told is None:
        return []
    value = np.array(told[PLACES[effect]], dtype=float).reshape(-1, 2)
    return [(float(x), float(y)) for x, y in value]
