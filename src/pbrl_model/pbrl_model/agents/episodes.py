"""Episodes of one agent with one body: observe, update the model, plan with A*, act (thesis figure 23)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import ActionSet, Domain, Goal, Scene, Thing
from pbrl_model.agents.models import LocalModel, MotionModel, ObjectOrientedModel, PhysicsModel, TrueModel
from pbrl_model.agents.motions import push_ends
from pbrl_model.agents.obstacles import edges, obstacles_of
from pbrl_model.agents.planning import Planner, SearchOptions, Sensing, Space
from pbrl_model.agents.plans import Plan
from pbrl_model.agents.room import Observer, Room, jittered
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

AGENTS = ("truth", "pbrl", "oo-lwr", "lwr")
FIRST_PUSHES = {"truth": 0, "pbrl": 1, "oo-lwr": 20, "lwr": 20}
"""Pushes at random before the first plan: there are sixteen, and a regression has to see how they differ."""
CURIOSITY = {"truth": 0.0, "pbrl": 0.0, "oo-lwr": 0.2, "lwr": 0.2}
"""Share of pushes at random afterwards: a regression that is wrong where it thinks it is right learns nothing new."""
FINE = SearchOptions(weight=1.5)  # a plan of at most half as many pushes again as the shortest
COARSE = SearchOptions(cell=0.1, turns=24, weight=1.5)  # a model that is centimetres off has no use for finer cells
HELD_OUT = 200
RECOVERED = 0.995  # r2, the thesis's threshold of section 5.5.1


@dataclass(frozen=True)
class Episode:
    """What happened.

    Attributes:
        agent: one of `AGENTS`.
        seed: of the episode.
        reward: (n + 1,) minus the distance from the goal [m], before the first push and after each.
        poses: (n + 1, 3) of the body, true.
        actions: (n,) indices; -1: stayed, the goal being reached.
        accuracy: (n + 1,) r2 of the model on held-out pushes; NaN before it is ready.
        statuses: (n,) sentences of the planner.
        expanded: (n,) nodes of each search.
        reached: whether the goal was reached at the end.
    """

    agent: str
    seed: int
    reward: Array
    poses: Array
    actions: NDArray[np.int64]
    accuracy: Array
    statuses: tuple[str, ...]
    expanded: NDArray[np.int64]
    reached: bool

    @property
    def recovered_after(self) -> float:
        """Return the number of pushes after which the model was right and stayed so; NaN: never."""
        right = self.accuracy >= RECOVERED
        wrong = np.flatnonzero(~right)
        first = 0 if not wrong.size else int(wrong[-1]) + 1
        return float(first) if first < len(right) else float("nan")


def run_episode(domain: Domain, agent: str, seed: int, options: SearchOptions | None = None) -> Episode:
    """Play one episode of a domain of one body.

    Args:
        domain: with actions and a goal.
        agent: one of `AGENTS`.
        seed: of the start, the noise and the agent; the start is the same for all agents.
        options: of the search; None: `FINE` or `COARSE`.

    Raises:
        ModelError: the agent is unknown, or the domain is not of one body with actions and a goal.
    """
    thing, actions, goal = _single(domain)
    if agent not in AGENTS:
        raise ModelError(f"agent: expected one of {', '.join(AGENTS)}, got {agent!r}")
    start_rng, noise_rng, agent_rng, test_rng = (np.random.default_rng([seed, part]) for part in range(4))
    room, observer = Room(domain, jittered(start_rng, domain)), Observer(noise_rng, domain)
    model, sensing = make_model(domain, agent, agent_rng)
    knows_walls = agent in ("truth", "pbrl")
    settings = options or (FINE if knows_walls else COARSE)
    planner = Planner(thing, space_of(domain.scene, knows_walls=knows_walls), settings, sensing)
    test = random_actions(test_rng, actions, HELD_OUT)
    true_ends = push_ends(thing, domain.truth[thing.name].parameters.to_vector()[None], test)[0]
    seen = observer.look(room.state)
    driver = Driver(agent_rng, model, planner, actions, goal, FIRST_PUSHES[agent], CURIOSITY[agent])
    poses, chosen, accuracy = [room.state[0, :3]], [], [_accuracy(model, test, true_ends)]
    statuses, expanded = [], []
    for _ in range(domain.steps):
        action, plan = driver.choose(seen[0, :3])
        statuses.append(plan.status.value if plan else "a push at random")
        expanded.append(plan.expanded if plan else 0)
        if action is None:
            chosen.append(-1)
            accuracy.append(accuracy[-1])
        else:
            chosen.append(action)
            done = room.push(0, actions.in_world(action, seen[0, 2]), float(actions.duration[action]))
            watched = observer.watch(done, seen)
            model.observe(watched)
            seen = watched.after
            accuracy.append(_accuracy(model, test, true_ends))
        poses.append(room.state[0, :3])
    path = np.array(poses)
    reward = -np.hypot(*(path[:, :2] - goal.pose[:2]).T)
    return Episode(
        agent,
        seed,
        reward,
        path,
        np.array(chosen),
        np.array(accuracy),
        tuple(statuses),
        np.array(expanded),
        goal.reached(path[-1]),
    )


class Driver:
    """Chooses pushes: at random first, then the first of a new plan after every observation.

    Args:
        rng: source of the random pushes.
        model: what the agent believes.
        planner: of the body.
        actions: to choose among.
        goal: to be reached.
        first: pushes at random before the first plan.
        curiosity: share of pushes at random afterwards.
    """

    def __init__(
        self,
        rng: np.random.Generator,
        model: MotionModel,
        planner: Planner,
        actions: ActionSet,
        goal: Goal,
        first: int,
        curiosity: float = 0.0,
    ) -> None:
        self._rng, self._model, self._planner = rng, model, planner
        self._actions, self._goal, self._first = actions, goal, first
        self._made, self._curiosity = 0, curiosity

    def choose(self, pose: Array) -> tuple[int | None, Plan | None]:
        """Return an action and the plan that it starts; no action at the goal, no plan for a random one."""
        self._made += 1
        if self._goal.reached(pose):
            return None, None
        if self._made <= self._first or not self._model.ready or self._rng.random() < self._curiosity:
            return int(self._rng.integers(len(self._actions))), None
        plan = self._planner.plan(pose, self._goal, self._model.motions(self._actions))
        if plan.reaches and not len(plan.actions):
            return None, plan
        if not len(plan.actions):  # nothing leads nearer: something has to be tried
            return int(self._rng.integers(len(self._actions))), plan
        return int(plan.actions[0]), plan


def make_model(domain: Domain, agent: str, rng: np.random.Generator) -> tuple[MotionModel, Sensing | None]:
    """Return an agent's model of the domain's one body, and the contact predicates it tells apart, if any."""
    thing = domain.scene.things[0]
    if agent == "truth":
        return TrueModel(thing, domain.truth[thing.name].parameters), None
    if agent == "pbrl":
        return PhysicsModel(rng, thing), None
    if agent == "lwr":
        return LocalModel(), None
    model = ObjectOrientedModel(domain.scene)
    return model, model.sensing()


def space_of(scene: Scene, *, knows_walls: bool = True) -> Space:
    """Return the floor with its walls."""
    obstacles = obstacles_of([*edges(scene.outline), *scene.walls])
    return Space(scene.outline.min(axis=0), scene.outline.max(axis=0), obstacles, knows_walls=knows_walls)


def random_actions(rng: np.random.Generator, actions: ActionSet, n: int) -> ActionSet:
    """Return n pushes drawn from the box that a set of actions spans."""
    lower, upper = actions.wrench.min(axis=0), actions.wrench.max(axis=0)
    seconds = rng.uniform(actions.duration.min(), actions.duration.max(), n)
    return ActionSet(rng.uniform(lower, upper, (n, 3)), np.round(seconds, 2))


def _accuracy(model: MotionModel, test: ActionSet, truth: Array) -> float:
    """Return the mean of R^2 over x, y and heading of where held-out pushes end."""
    if not model.ready:
        return float("nan")
    error = ((model.ends(test) - truth) ** 2).sum(axis=0)
    return float(np.mean(1.0 - error / ((truth - truth.mean(axis=0)) ** 2).sum(axis=0)))


def _single(domain: Domain) -> tuple[Thing, ActionSet, Goal]:
    things = domain.scene.things
    if len(things) != 1 or domain.actions is None or things[0].goal is None:
        raise ModelError(
            f"{domain.scene.name}: expected one object with a goal, and actions; got {len(things)} objects"
        )
    return things[0], domain.actions, things[0].goal
