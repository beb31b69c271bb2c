"""What an agent may believe of one body: the truth, a posterior over physics, or regression (thesis section 5.5.1).

Each takes observed pushes and says where pushes from rest bring the body to rest again, in the body's axes; that is all
that the planner asks. Physics learns from the push and the coasting after it as two transitions, the regressions from
the whole as one, which spares them from having to learn what friction does to every speed.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pbrl_bag.types import BodyGeometry
from pbrl_model.agents.domain import ActionSet, Scene, Thing
from pbrl_model.agents.motions import expected_motions, physics_motions, push_ends
from pbrl_model.agents.obstacles import edges
from pbrl_model.agents.planning import Motions, Sensing
from pbrl_model.agents.room import Push
from pbrl_model.baselines.local import LocallyWeightedRegression
from pbrl_model.baselines.object_oriented import ObjectOrientedRegression
from pbrl_model.baselines.sectors import ContactSectors
from pbrl_model.parameters import BodyParameters
from pbrl_model.posterior import Posterior
from pbrl_model.prior_options import GroundOptions, PriorOptions
from pbrl_model.transitions.data import Transitions, concatenate, displacements
from pbrl_model.transitions.model import LearnOptions, TransitionPosterior, learn, update

Array = NDArray[np.float64]

PLANNING_DRAWS = 24  # of the posterior, whose mean the planner is given
GROUND_SD = 0.2  # the domains' things stand on feet: their friction on the floor is not small


class MotionModel(Protocol):
    """A belief about how one body moves."""

    def observe(self, push: Push) -> None:
        """Learn from a push of this body."""
        ...

    @property
    def ready(self) -> bool:
        """Tell whether anything was learned yet."""
        ...

    def motions(self, actions: ActionSet) -> Motions:
        """Return what each push is expected to do."""
        ...

    def ends(self, actions: ActionSet) -> Array:
        """Return (A, 3) where pushes from rest at the origin are expected to end, touching nothing."""
        ...


class TrueModel:
    """The truth: what the baseline agent is given."""

    def __init__(self, thing: Thing, parameters: BodyParameters) -> None:
        self._thing, self._parameters = thing, parameters

    @property
    def ready(self) -> bool:
        """There is nothing to learn."""
        return True

    def observe(self, push: Push) -> None:
        """Take no notice."""

    def motions(self, actions: ActionSet) -> Motions:
        """Return what each push does."""
        return physics_motions(self._thing, self._parameters, actions)

    def ends(self, actions: ActionSet) -> Array:
        """Return (A, 3) where pushes end."""
        return push_ends(self._thing, self._parameters.to_vector()[None], actions)[0]


class LearnedModel:
    """A posterior that was learned before, such as `load_posterior` reads from a repaired model's file.

    Args:
        thing: the body.
        posterior: of it.
    """

    def __init__(self, thing: Thing, posterior: Posterior) -> None:
        rows = posterior.rows()
        self._thing, self._rows = thing, rows[:: max(1, len(rows) // PLANNING_DRAWS)][:PLANNING_DRAWS]

    @property
    def ready(self) -> bool:
        """There is nothing more to learn."""
        return True

    def observe(self, push: Push) -> None:
        """Take no notice."""

    def motions(self, actions: ActionSet) -> Motions:
        """Return the posterior's mean of what each push does."""
        return expected_motions(self._thing, self._rows, actions)[0]

    def ends(self, actions: ActionSet) -> Array:
        """Return (A, 3) the posterior's mean of where pushes end."""
        return push_ends(self._thing, self._rows, actions).mean(axis=0)


class PhysicsModel:
    """A posterior over physics, classes of constraint included (thesis section 5.3, PBRL).

    Args:
        rng: source of randomness of the inference.
        thing: the body.
        index: of the body in observed states.
        options: of the learner; None: friction on the floor is learned, one core.

    Attributes:
        posterior: None until the body was pushed.
    """

    def __init__(
        self, rng: np.random.Generator, thing: Thing, index: int = 0, options: LearnOptions | None = None
    ) -> None:
        self._rng, self._thing, self._index = rng, thing, index
        self._options = options or learn_options()
        self._geometry = BodyGeometry(thing.name, thing.footprint, float("nan"), float("nan"), True, thing.start)
        self.posterior: TransitionPosterior | None = None

    @property
    def ready(self) -> bool:
        """Tell whether a push was seen."""
        return self.posterior is not None

    def observe(self, push: Push) -> None:
        """Update the posterior with the push and the coasting after it."""
        rows = push.transitions()
        if self.posterior is None:
            self.posterior = learn(self._rng, rows, self._index, self._geometry, self._options)
        else:
            self.posterior = update(self._rng, self.posterior, rows, self._index)

    def draws(self) -> Array:
        """Return (P, 12) draws as kernel rows.

        Raises:
            ValueError: nothing was observed.
        """
        if self.posterior is None:
            raise ValueError(f"{self._thing.name}: nothing was observed yet")
        return self.posterior.rows[:PLANNING_DRAWS]

    def motions(self, actions: ActionSet) -> Motions:
        """Return the posterior's mean of what each push does."""
        return expected_motions(self._thing, self.draws(), actions)[0]

    def ends(self, actions: ActionSet) -> Array:
        """Return (A, 3) the posterior's mean of where pushes end."""
        return push_ends(self._thing, self.draws(), actions).mean(axis=0)


def learn_options() -> LearnOptions:
    """Return the settings of learning in the domains: friction on the floor is learned too; one core."""
    return LearnOptions(ground=True, parallel=False, priors=PriorOptions(ground=GroundOptions(sd=GROUND_SD)))


class LocalModel:
    """Locally weighted regression, which knows no contact (LWR).

    Args:
        index: of the body in observed states.
    """

    def __init__(self, index: int = 0) -> None:
        self._index = index
        self._seen: list[Transitions] = []
        self._model: LocallyWeightedRegression | None = None

    @property
    def ready(self) -> bool:
        """Tell whether a push was seen."""
        return bool(self._seen)

    def observe(self, push: Push) -> None:
        """Keep the push from rest to rest."""
        self._seen.append(push.whole())
        self._model = None

    def motions(self, actions: ActionSet) -> Motions:
        """Return what each push is predicted to do."""
        return Motions(self.ends(actions)[None, :, None], np.ones(len(actions)))

    def ends(self, actions: ActionSet) -> Array:
        """Return (A, 3) predicted ends."""
        return self.ends_of(self._index, actions)

    def ends_of(self, index: int, actions: ActionSet) -> Array:
        """Return (A, 3) predicted ends of pushes of any of the bodies."""
        if self._model is None:
            self._model = LocallyWeightedRegression().fit(concatenate(self._seen))
        return _predicted(self._model, np.zeros_like(self._seen[0].state[0]), index, actions)


class ObjectOrientedModel:
    """Locally weighted regression by condition of contact (OO-LWR).

    Args:
        scene: of bodies among walls.
    """

    def __init__(self, scene: Scene) -> None:
        walls = np.array([side for outline in (scene.outline, *scene.walls) for side in edges(outline)])
        self._sectors = ContactSectors([thing.footprint for thing in scene.things], walls)
        self._model = ObjectOrientedRegression(self._sectors)
        self._anywhere = LocalModel()
        self._new: list[Transitions] = []
        self._met: dict[bytes, Array] = {}

    @property
    def ready(self) -> bool:
        """Tell whether a push was seen."""
        return self._anywhere.ready

    @property
    def conditions(self) -> int:
        """How many conditions of contact have been met."""
        return len(self._met)

    def sensing(self, index: int = 0) -> Sensing:
        """Return the rays of a body's contact predicates, as the planner takes them."""
        return sensing_of(self._sectors, index)

    def observe(self, push: Push) -> None:
        """Learn the push under the condition of contact in which it began."""
        rows = push.whole()
        self._new.append(rows)
        self._anywhere.observe(push)
        self._met.setdefault(self._sectors.conditions(rows.state)[0].tobytes(), rows.state[0])

    def motions(self, actions: ActionSet) -> Motions:
        """Return what each push of the only body is predicted to do, in each condition."""
        return self.motions_of(0, np.zeros((1, 6)), actions)

    def motions_of(self, index: int, state: Array, actions: ActionSet) -> Motions:
        """Return what each push of a body is predicted to do.

        Args:
            index: of the body.
            state: (K, 6) as everything stands; what touches the other bodies is taken to stay.
            actions: the pushes.

        Returns:
            Motions by condition of the body's own sectors; where one was never met, as over all conditions.
        """
        if self._new:
            self._model.extend(concatenate(self._new))
            self._new = []
        sectors = self._sectors.sectors
        table = np.repeat(self._anywhere.ends_of(index, actions)[None], 2**sectors, axis=0)
        bits = self._sectors.contacts(state[None])[0]
        for condition in range(2**sectors):
            bits[index] = (condition >> np.arange(sectors)) & 1
            met = self._met.get(bits.reshape(-1).tobytes())
            if met is not None:
                table[condition] = _predicted(self._model, met, index, actions)
        return Motions(table[:, :, None], np.ones(len(actions)))

    def ends(self, actions: ActionSet) -> Array:
        """Return (A, 3) predicted ends of pushes of the only body where nothing is near."""
        return self.motions(actions).table[0, :, -1]


def sensing_of(sectors: ContactSectors, body: int) -> Sensing:
    """Return a body's rays of contact predicates as the compiled search takes them."""
    rays = sectors._rays[body].reshape(sectors.sectors, -1, 2, 2)
    along = (rays[:, :, 1] - rays[:, :, 0]) / sectors._radius
    return Sensing(np.concatenate([rays[:, :, 0], along], axis=2), sectors._radius)


def _predicted(
    model: LocallyWeightedRegression | ObjectOrientedRegression, state: Array, index: int, actions: ActionSet
) -> Array:
    """Return (A, 3) displacements in the body's axes that a regression predicts from a state (K, 6)."""
    states = np.repeat(state[None], len(actions), axis=0)
    wrench = np.array([actions.in_world(action, state[index, 2]) for action in range(len(actions))])
    after = model.predict(states, np.full(len(actions), index), wrench, actions.duration)
    return displacements(states[:, index], after[:, index])[:, :3]
