"""Episodes with many bodies: get to know each by a few pushes, then bring them to their goals (thesis figure 23c)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pbrl_model.agents.domain import ActionSet, Domain
from pbrl_model.agents.episodes import COARSE
from pbrl_model.agents.exploration import GENTLE, telling_push, unknown_push
from pbrl_model.agents.joint_posterior import JointLearner, JointPosterior, space_among
from pbrl_model.agents.models import PLANNING_DRAWS, ObjectOrientedModel
from pbrl_model.agents.planning import Planner
from pbrl_model.agents.plans import Plan
from pbrl_model.agents.pushes import DURATION, STRENGTH, fitted_actions
from pbrl_model.agents.rearrangement import Rearrangement, Skill, skill_of
from pbrl_model.agents.room import Observer, Push, Room, jittered
from pbrl_model.errors import ModelError

Array = NDArray[np.float64]

MOVED = 0.04  # [m] a body that went this far has moved
FIRST_PUSHES = 12  # at most, until one has moved it without touching anything
TELLING_PUSHES = 4  # at most, until the posterior's draws agree
AGREE = 0.012  # [m] how far draws may differ about where pushes end, in the median over the pushes


@dataclass(frozen=True)
class Rearranged:
    """An episode.

    Attributes:
        agent: "truth", "pbrl" or "oo-lwr".
        seed: of the episode.
        reward: (n + 1,) minus the mean distance of the things with goals from them [m], before and after each push.
        states: (n + 1, K, 3) true poses.
        learning: how many of the pushes were made to learn.
        reached: by name, whether a thing with a goal is at it, in truth.
        distance: by name, from the goal [m].
        classes: by name, the most probable class; empty where none was learned.
        converged: how many bodies' inferences converged.
        plans: (name, status, pushes) of every plan carried out.
        notes: of the inference and the planner.
    """

    agent: str
    seed: int
    reward: Array
    states: Array
    learning: int
    reached: dict[str, bool]
    distance: dict[str, float]
    classes: dict[str, str]
    converged: int
    plans: tuple[tuple[str, str, int], ...]
    notes: tuple[str, ...]

    @property
    def success(self) -> bool:
        """Tell whether everything is where it is wanted."""
        return all(self.reached.values())


class Play:
    """The true room with a record of what was done in it.

    Args:
        domain: scene and truth.
        seed: of start and noise.
    """

    def __init__(self, domain: Domain, seed: int) -> None:
        self._domain = domain
        self._room = Room(domain, jittered(np.random.default_rng([seed, 0]), domain))
        self._observer = Observer(np.random.default_rng([seed, 1]), domain)
        self.seen = self._observer.look(self._room.state)
        self.states = [self._room.state[:, :3].copy()]

    def act(self, index: int, wrench: Array, duration: float) -> Push:
        """Carry out a push and return it as it is seen."""
        push = self._observer.watch(self._room.push(index, wrench, duration), self.seen)
        self.seen = push.after
        self.states.append(self._room.state[:, :3].copy())
        return push

    def record(
        self,
        agent: str,
        seed: int,
        learning: int,
        plans: list[tuple[str, str, int]],
        notes: list[str],
        posterior: JointPosterior | None = None,
    ) -> Rearranged:
        """Return the episode as it went."""
        goals = {index: thing for index, thing in enumerate(self._domain.scene.things) if thing.goal is not None}
        states = np.array(self.states)
        gaps = [
            np.hypot(*(states[:, index, :2] - thing.goal.pose[:2]).T) for index, thing in goals.items() if thing.goal
        ]
        reached = {thing.name: thing.goal.reached(states[-1, index]) for index, thing in goals.items() if thing.goal}
        distance = {thing.name: thing.goal.distance(states[-1, index]) for index, thing in goals.items() if thing.goal}
        names = self._domain.scene.names
        classes = {name: posterior.best_class(index) for index, name in enumerate(names)} if posterior else {}
        converged = int(posterior.converged.sum()) if posterior else 0
        told = (*notes, *(posterior.notes if posterior else ()))
        return Rearranged(
            agent,
            seed,
            -np.mean(gaps, axis=0),
            states,
            learning,
            reached,
            distance,
            classes,
            converged,
            tuple(plans),
            told,
        )


def play_truth(domain: Domain, seed: int) -> Rearranged:
    """Play an episode with the true model given."""
    play = Play(domain, seed)
    rows = [domain.truth[name].parameters.to_vector()[None] for name in domain.scene.names]
    skills = [skill_of(domain.scene, index, row) for index, row in enumerate(rows)]
    work = Rearrangement(domain.scene, skills, play.act, play.seen)
    work.run()
    return play.record("truth", seed, 0, work.plans, work.notes)


def play_pbrl(domain: Domain, seed: int) -> tuple[Rearranged, JointPosterior]:
    """Play an episode in which everything is learned from pushes of the agent's own choosing."""
    play, rng = Play(domain, seed), np.random.default_rng([seed, 2])
    learner = JointLearner(np.random.default_rng([seed, 3]), domain.scene)
    for index in range(len(domain.scene.things)):
        get_to_know(rng, play, learner, domain, index)
    learning = len(play.states) - 1
    posterior = learner.joint()
    skills = [
        skill_of(domain.scene, index, posterior.rows[:PLANNING_DRAWS, index])
        for index in range(len(domain.scene.things))
    ]

    def revise(index: int, push: Push) -> Skill | None:
        if not learner.observe(push):
            return None
        learned = learner.learn(index)
        return skill_of(domain.scene, index, learned.rows[:PLANNING_DRAWS]) if learned else None

    work = Rearrangement(domain.scene, skills, play.act, play.seen, revise)
    work.run()
    return play.record("pbrl", seed, learning, work.plans, work.notes, posterior), posterior


def play_oo_lwr(domain: Domain, seed: int, observations: int, pushes: int) -> Rearranged:
    """Play an episode of OO-LWR with bounded budgets.

    It is spared what it cannot know: its pushes are as strong as the true model says is needed.

    Args:
        domain: scene and truth.
        seed: of the episode.
        observations: pushes at random, each body in turn, before the first plan.
        pushes: towards the goals afterwards.
    """
    play, rng = Play(domain, seed), np.random.default_rng([seed, 2])
    things, model = domain.scene.things, ObjectOrientedModel(domain.scene)
    sets = [fitted_actions(thing, domain.truth[thing.name].parameters.to_vector()[None]) for thing in things]
    for number in range(observations):
        index = number % len(things)
        choice = int(rng.integers(len(sets[index])))
        model.observe(_pushed(play, sets[index], index, choice))
    left, planned = [index for index, thing in enumerate(things) if thing.goal is not None], 0
    for number in range(pushes):
        waiting = [index for index in left if not _is_there(domain, play, index)]
        if not waiting:
            break
        index = waiting[number % len(waiting)]
        plan = _planned(domain, play, model, sets[index], index)
        planned += plan.reaches
        choice = int(plan.actions[0]) if len(plan.actions) else int(rng.integers(len(sets[index])))
        model.observe(_pushed(play, sets[index], index, choice))
    notes = [
        f"{model.conditions} conditions of contact met in {len(play.states) - 1} pushes; {planned} searches believed "
        "to have a plan"
    ]
    return play.record("oo-lwr", seed, observations, [], notes)


def _pushed(play: Play, actions: ActionSet, index: int, choice: int) -> Push:
    wrench = actions.in_world(choice, float(play.seen[index, 2]))
    return play.act(index, wrench, float(actions.duration[choice]))


def _is_there(domain: Domain, play: Play, index: int) -> bool:
    goal = domain.scene.things[index].goal
    return goal is None or goal.reached(play.seen[index, :3])


def _planned(domain: Domain, play: Play, model: ObjectOrientedModel, actions: ActionSet, index: int) -> Plan:
    thing = domain.scene.things[index]
    if thing.goal is None:
        raise ModelError(f"{thing.name}: expected a goal")
    space = replace(space_among(domain.scene, play.seen, index), knows_walls=False)
    planner = Planner(thing, space, COARSE, model.sensing(index))
    return planner.plan(play.seen[index, :3], thing.goal, model.motions_of(index, play.seen, actions))


def get_to_know(rng: np.random.Generator, play: Play, learner: JointLearner, domain: Domain, index: int) -> None:
    """Push a body ever harder until it moves, learn, then push it where the posterior is least sure."""
    strength = GENTLE
    for _ in range(FIRST_PUSHES):
        before = play.seen
        push = play.act(index, unknown_push(rng, domain.scene, before, index, strength), DURATION)
        free, moved = learner.observe(push), np.hypot(*(push.after[index, :2] - before[index, :2])) > MOVED
        if free and moved:
            break
        strength = min(strength if moved else 1.7 * strength, STRENGTH)
    for number in range(TELLING_PUSHES):
        posterior = learner.learn(index)
        if posterior is None:
            return
        rows = posterior.rows[:PLANNING_DRAWS]
        if number > 0 and skill_of(domain.scene, index, rows).spread < AGREE:
            return
        told = telling_push(rng, domain.scene, play.seen, index, rows)
        if told is None:
            return
        learner.observe(play.act(index, *told))
    learner.learn(index)
