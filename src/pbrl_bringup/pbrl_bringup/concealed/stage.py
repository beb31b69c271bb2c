"""The stage of a concealed case: a random table, how it is pushed, and where it goes if nothing is concealed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bullet_sim.errors import SimError
from bullet_sim.hand import HandSpec
from bullet_sim.hand_push import push_by_hand
from bullet_sim.hand_recording import BodyTrack, HandPath, HandPush, HandRecording, Limits
from bullet_sim.scene import Scene, WristSettings
from pbrl_bringup.errors import BringupError

Array = NDArray[np.float64]

NAME = "table"
SECONDS, PUSHES = 16.0, 3
"""Of one push, and how many there are."""
KNOT = 0.1
"""Between knots of a path [s]."""
RAMP = 0.6
"""In which a push begins and ends [s]."""
SPEED, SWAY, SPIN = (0.07, 0.13), 0.04, 0.25
"""Ranges of a push: forth and back, sideways [m/s], turning [rad/s]."""
WHEEL_SHARE = 0.5
"""Of the tables that have the one wheel of the baseline class."""
ROOM = 6.0
"""Half the extent of the room [m]."""
FASTEST, SPINNING, SLIPPED = 0.4, 0.6, 0.008
"""Of a push that counts: speed of the table [m/s], its turning [rad/s], way of its edge in the hand [m]."""
RANGE = 0.95
"""Of a wrist sensor that may be used: at its end it shows less than there is."""
PINNED = "hidden_hinge"
"""The effect against which a hand cannot win."""
SOFT = HandSpec(force_limit=34.0, torque_limit=2.5)
"""The hand that holds a pinned table: what it cannot move it follows, and the wrist stays within its range."""
STRAIN, TURNING, LEVER = 0.6, 0.4, 0.3
"""Of a push about a pin: share of the sway that pulls at the pin, turning at most [rad/s], least lever [m]."""
TRIES = 24
"""Pushes that are drawn before a table counts as one that cannot be pushed."""


@dataclass(frozen=True)
class Stage:
    """Everything but what is concealed.

    Attributes:
        scene: settings of the scene, nothing in `concealed` but what belongs to the baseline class.
        pushes: what the hand does.
        seed: of the simulation.
        track: where the table goes if nothing is concealed.
        bare: the recording of that, where it was kept.
    """

    scene: dict[str, object]
    pushes: tuple[HandPush, ...]
    seed: int
    track: BodyTrack
    bare: HandRecording | None = None

    @property
    def half(self) -> Array:
        """Half the table's extent (2,) [m]."""
        return np.array(self.table["size"], dtype=float) / 2.0

    @property
    def table(self) -> dict[str, object]:
        """Settings of the table."""
        bodies: dict[str, dict[str, object]] = self.scene["bodies"]  # type: ignore[assignment]
        return bodies[NAME]

    @property
    def mass(self) -> float:
        """Of the table [kg]."""
        return float(self.table["nominal_mass"])  # type: ignore[arg-type]

    def moving(self, least: float = 0.03) -> NDArray[np.int64]:
        """Return samples of the track at which the table moves faster than `least` [m/s]."""
        speed = np.hypot(*self.track.twist[:, :2].T) + 0.5 * np.abs(self.track.twist[:, 2])
        return np.flatnonzero(speed > least)

    def with_concealed(self, concealed: dict[str, object]) -> Scene:
        """Return the scene with more concealed in it."""
        known: dict[str, object] = dict(self.scene["concealed"])  # type: ignore[call-overload]
        return Scene.model_validate({**self.scene, "concealed": {**known, **concealed}})


def draw_stage(rng: np.random.Generator) -> Stage:
    """Draw a table and pushes that it survives.

    Args:
        rng: source of randomness.

    Raises:
        BringupError: none of the pushes drawn can be done.
    """
    scene = _scene(rng)
    table: dict[str, object] = scene["bodies"][NAME]  # type: ignore[index]
    half = np.array(table["size"], dtype=float) / 2.0
    why = ""
    for number in range(TRIES):
        pushes = tuple(draw_push(rng, half, gentle=0.85**number) for _ in range(PUSHES))
        seed = int(rng.integers(2**31))
        try:
            found = push_by_hand(Scene.model_validate(scene), pushes, seed=seed, limits=careful())
        except SimError as error:  # a table without friction may have rolled on until the hand came back
            why = str(error)
            continue
        why = found.status if found.status != "done" else violence(found)
        if not why:
            return Stage(scene, pushes, seed, found.bodies[NAME], found)
    raise BringupError(f"concealed: expected one of {TRIES} drawn pushes to succeed, got {why!r} in the last")


def careful() -> Limits:
    """Return the limits of a push that counts, at which a draw is given up."""
    sensor = WristSettings()
    force, torque = (RANGE * np.array(each) for each in (sensor.force_range, sensor.torque_range))
    return Limits(FASTEST, SPINNING, SLIPPED, force, torque)


def violence(found: HandRecording) -> str:
    """Say what no careful robot would let happen, or nothing: a table that swings, an edge that slides in the hand."""
    twist = found.bodies[NAME].twist
    speed, spin = float(np.hypot(*twist[:, :2].T).max()), float(np.abs(twist[:, 2]).max())
    if speed > FASTEST or spin > SPINNING:
        return f"the table swings, {speed:.2f} m/s and {spin:.2f} rad/s"
    if found.slipped > SLIPPED:
        return f"it slips by {1000.0 * found.slipped:.0f} mm in the hand"
    return "the wrist sensor is at its end" if saturated(found) else ""


def saturated(found: HandRecording) -> bool:
    """Tell whether a wrist sensor came near the end of its range, where a force or a torque is more than it shows."""
    limits = careful()
    force, torque = np.abs(found.wrench.force), np.abs(found.wrench.torque)
    return bool(np.any(force > limits.force) or np.any(torque > limits.torque))


def play(stage: Stage, concealed: dict[str, object]) -> HandRecording:
    """Push the table of a stage with something concealed; a pinned one is pushed softly."""
    if not concealed and stage.bare is not None:
        return stage.bare
    scene, pushes, hand = stage.with_concealed(concealed), stage.pushes, None
    if PINNED in concealed:
        pin = np.array(scene.concealed.hidden_hinge[NAME].point)
        pushes, hand = tuple(about_pin(each, stage.half, pin) for each in pushes), SOFT
    return push_by_hand(scene, pushes, seed=stage.seed, hand=hand)


def about_pin(push: HandPush, half: Array, pin: Array) -> HandPush:
    """Return a push that goes the one way a pin leaves, and pulls at it a little.

    A hand that feels that it cannot go straight on goes about what holds it. Its path is in its own axes, and it holds
    the table: the way about the pin is always the same there.

    Args:
        push: as for a free table, along the approach and to its left.
        half: (2,) half the table's extent [m].
        pin: (2,) its place, body's frame [m].
    """
    contact = np.array(push.contact)
    side = int(np.argmax(np.abs(contact) / half))
    inwards = np.zeros(2)
    inwards[side] = -np.sign(contact[side])
    arm = contact + 0.5 * SOFT.depth * inwards - pin
    left = np.array([-inwards[1], inwards[0]])
    way = np.array([inwards @ (-arm[1], arm[0]), left @ (-arm[1], arm[0])])
    away = np.array([inwards @ arm, left @ arm]) / max(float(np.hypot(*arm)), 1e-6)
    speed, sway, _ = push.path.twist.T
    turn = np.clip(speed / max(float(np.hypot(*arm)), LEVER), -TURNING, TURNING)
    along = turn[:, None] * way + STRAIN * sway[:, None] * away
    return HandPush(push.body, push.contact, HandPath(push.path.time, np.column_stack([along, turn]), "hand"))


def _scene(rng: np.random.Generator) -> dict[str, object]:
    size = [float(rng.uniform(0.6, 0.9)), float(rng.uniform(1.0, 1.6))]
    concealed: dict[str, object] = {}
    mass = float(rng.uniform(16.0, 40.0))
    if rng.random() < WHEEL_SHARE:
        concealed["wheel"] = {NAME: draw_wheel(rng, np.array(size) / 2.0, mass)}
    outline = [[-ROOM, -ROOM], [ROOM, -ROOM], [ROOM, ROOM], [-ROOM, ROOM]]
    table = {
        "kind": "plain_table",
        "size": size,
        "nominal_mass": mass,
        "pose": [0.0, 0.0, float(rng.uniform(-math.pi, math.pi))],
    }
    return {"name": "concealed", "room": {"outline": outline}, "bodies": {NAME: table}, "concealed": concealed}


def draw_wheel(rng: np.random.Generator, half: Array, mass: float) -> dict[str, object]:
    """Draw the one wheel that a table of the baseline class may have.

    Args:
        rng: source of randomness.
        half: (2,) half the table's extent [m].
        mass: of the table [kg].
    """
    place = (rng.uniform(-0.8, 0.8, 2) * half).tolist()
    load = float(rng.uniform(0.2, 0.4) * mass * 9.81)
    return {"position": place, "heading": float(rng.uniform(-1.5, 1.5)), "load": load}


def draw_push(rng: np.random.Generator, half: Array, gentle: float) -> HandPush:
    """Draw a grasp of an edge and a path: forth and back with changing speed, swaying and turning a little."""
    side, along = rng.integers(4), rng.uniform(-0.7, 0.7)
    contact = ((along * half[0], half[1]), (-half[0], along * half[1]), (along * half[0], -half[1]), (half[0], 0.0))
    time = np.arange(0.0, SECONDS + 1e-9, KNOT)
    ramp = np.minimum(1.0, np.minimum(time, time[-1] - time) / RAMP)
    fast, rate = rng.uniform(*SPEED), rng.uniform(0.5, 1.1)
    speed = fast * (0.55 + 0.9 * np.sin(rate * time + rng.uniform(0, 6)) + 0.2 * np.sin(2.7 * time + rng.uniform(0, 6)))
    sway = SWAY * np.sin(rng.uniform(0.4, 1.3) * time + rng.uniform(0, 6))
    spin = SPIN * np.sin(rng.uniform(0.3, 0.9) * time + rng.uniform(0, 6))
    twist = gentle * np.column_stack([speed, sway, spin]) * ramp[:, None]
    x, y = contact[int(side)]
    return HandPush(NAME, (float(x), float(y)), HandPath(time, twist, "hand"))
