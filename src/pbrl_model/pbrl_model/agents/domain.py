"""Domains of thesis section 5.5.1: what an agent knows (geometry, goals, actions), and the truth, which is concealed.

Thesis figure 20 splits what describes a scene in two: geometry, which is observed, and physics, which is to be learned.
`Scene` is the first and all that learners are given; `Domain` holds both. Poses are (x, y, theta) in world, of centres
of mass; footprints are in the body's frame, whose origin is the centre of mass.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pbrl_model.errors import ModelError
from pbrl_model.geometry import check_polygon, mass_properties
from pbrl_model.parameters import BodyParameters, nearest

Array = NDArray[np.float64]

DT = 0.01  # [s] step of the simulations in agents and domains alike


@dataclass(frozen=True)
class Goal:
    """Where an object is wanted.

    Attributes:
        pose: (3,) of the centre of mass; a heading that is NaN does not matter.
        position_tolerance: [m].
        heading_tolerance: [rad].
    """

    pose: Array
    position_tolerance: float = 0.05
    heading_tolerance: float = 0.1

    def distance(self, pose: Array) -> float:
        """Return the distance [m] of a pose's place from the goal's."""
        return float(np.hypot(*(pose[:2] - self.pose[:2])))

    def turn(self, pose: Array) -> float:
        """Return the angle [rad] between a pose's heading and the goal's; zero where the heading does not matter."""
        difference = pose[2] - self.pose[2]
        return 0.0 if np.isnan(difference) else float(abs((difference + np.pi) % (2.0 * np.pi) - np.pi))

    def reached(self, pose: Array) -> bool:
        """Tell whether a pose is within both tolerances."""
        return self.distance(pose) <= self.position_tolerance and self.turn(pose) <= self.heading_tolerance


@dataclass(frozen=True)
class Thing:
    """What is known of a body.

    Attributes:
        name: unique in its scene.
        footprint: (k, 2) [m], about the centre of mass.
        start: (3,) pose at the start.
        goal: None: it may stand anywhere.
        inertia_per_mass: [m^2] of uniform density.
    """

    name: str
    footprint: Array
    start: Array
    goal: Goal | None = None
    inertia_per_mass: float = field(init=False)

    def __post_init__(self) -> None:
        properties = mass_properties(self.footprint)
        if np.abs(properties.com).max() > 1e-9:
            raise ModelError(f"{self.name}: expected a footprint about its centre of mass, got it at {properties.com}")
        object.__setattr__(self, "inertia_per_mass", properties.inertia_per_mass)


@dataclass(frozen=True)
class Scene:
    """What an agent knows before it has touched anything.

    Attributes:
        name: of the domain.
        outline: (k, 2) corners of the floor [m].
        walls: polygons (k, 2) [m] that stand on it.
        things: the bodies, in the order of every array over bodies.
    """

    name: str
    outline: Array
    walls: tuple[Array, ...]
    things: tuple[Thing, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bodies, in order."""
        return tuple(thing.name for thing in self.things)

    def index(self, name: str) -> int:
        """Return where a body stands in the order.

        Raises:
            ModelError: there is none of that name.
        """
        if name not in self.names:
            raise ModelError(
                f"{self.name}: expected one of {', '.join(self.names)}, got {name!r}{nearest(name, self.names)}"
            )
        return self.names.index(name)

    @property
    def start(self) -> Array:
        """Return the (K, 6) state at the start: everything at rest."""
        return np.array([[*thing.start, 0.0, 0.0, 0.0] for thing in self.things])


@dataclass(frozen=True)
class Physics:
    """The truth about a body.

    Attributes:
        parameters: mass, wheel, hinge, friction on the floor; wheel and anchor about the centre of mass.
        restitution: 0..1.
        contact_friction: Coulomb coefficient against other bodies and walls.
    """

    parameters: BodyParameters
    restitution: float = 0.0
    contact_friction: float = 0.3


@dataclass(frozen=True)
class ActionSet:
    """The pushes among which an agent chooses: wrenches in the axes of the pushed body as it stands at the start.

    During the push the wrench keeps its direction in world; then the body is let go and everything comes to rest.

    Attributes:
        wrench: (A, 3) [N, N, N m] at the centre of mass.
        duration: (A,) [s].
    """

    wrench: Array
    duration: Array

    def __post_init__(self) -> None:
        wrench, duration = np.asarray(self.wrench, dtype=float), np.asarray(self.duration, dtype=float)
        if wrench.ndim != 2 or wrench.shape[1] != 3 or duration.shape != wrench.shape[:1]:
            raise ModelError(
                f"actions: expected wrenches (n, 3) and durations (n,), got {wrench.shape}, {duration.shape}"
            )
        if not (np.isfinite(wrench).all() and np.isfinite(duration).all() and (duration >= DT).all()):
            raise ModelError(f"actions: expected finite wrenches and durations of at least {DT:g} s")
        object.__setattr__(self, "wrench", wrench)
        object.__setattr__(self, "duration", duration)

    def __len__(self) -> int:
        return len(self.duration)

    def in_world(self, index: int, heading: float) -> Array:
        """Return the (3,) wrench of one action on a body of that heading [rad], world axes."""
        fx, fy, tau = self.wrench[index]
        c, s = np.cos(heading), np.sin(heading)
        return np.array([c * fx - s * fy, s * fx + c * fy, tau])


@dataclass(frozen=True)
class Domain:
    """A scene and the truth about it.

    Attributes:
        scene: what agents are told.
        truth: physics by name.
        actions: the set for agents that do not make their own; None where they do.
        noise: standard deviation of every component of an observed state, in metres and metres a second; angles by
            the body's radius of gyration.
        steps: pushes in an episode.
        jitter: (3,) half widths by which the start of the things with goals varies between episodes.
    """

    scene: Scene
    truth: Mapping[str, Physics]
    actions: ActionSet | None = None
    noise: float = 0.0
    steps: int = 50
    jitter: tuple[float, float, float] = (0.0, 0.0, 0.0)


def centred(footprint: ArrayLike) -> tuple[Array, Array]:
    """Return a footprint about its centre of mass, and the (2,) centre of mass in the frame in which it was given."""
    outline = check_polygon(footprint)
    com = mass_properties(outline).com
    shifted = outline - com
    return shifted - mass_properties(shifted).com, com
