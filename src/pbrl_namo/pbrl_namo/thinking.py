"""What answers the executive's jobs: the NAMO planner, the search for grasps and ways, learning, diagnosis.

Only numbers go in and out, so that it works in a process of its own as well as at once; see `ProcessThinker`.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import shapely

from pbrl_bag.errors import BagError
from pbrl_bag.types import Recording
from pbrl_control.constraints.object_model import SwivelCasters
from pbrl_control.planar import Array
from pbrl_mismatch.diagnose import diagnose
from pbrl_mismatch.encounter import Encounter, find_encounter
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN
from pbrl_mismatch.online.slices import BEFORE, between
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import ObjectFit, fit_recording
from pbrl_model.fitting.options import FitOptions
from pbrl_model.parameters import KERNEL_COLUMNS
from pbrl_namo.beliefs.belief import ObjectBelief, belief_of_draws, prior_belief
from pbrl_namo.beliefs.stops import Stop
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import (
    Answer,
    Choice,
    GraspJob,
    Job,
    LearnAnswer,
    LearnJob,
    MismatchAnswer,
    MismatchJob,
    Move,
    PlanAnswer,
    PlanJob,
    Refused,
)
from pbrl_namo.executive.ways import find_grasp, find_way
from pbrl_namo.manipulation.plan import ManipulationPlan
from pbrl_namo.planner import NamoPlan, plan
from pbrl_namo.regions.free_space import drive_radius
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.settings import NamoSettings

Recorded = Callable[[float, float], Recording]
"""Gives what was recorded between two times on the recording's clock [s]."""

KEPT_DRAWS = 400
"""Of a posterior; so many tell shares to a few per cent."""
LEARNING = FitOptions(draws=KEPT_DRAWS // 4, burn_in=250, thin=2)
"""As many draws as are kept. Where importance sampling fails, as for a thing that hardly moves, they are those of
chains, and a robot that holds the thing waits for them: half a minute, where a fit's usual 5000 steps take four."""
WIDER = (0.0, 0.06, 0.06)
"""By so much the disc that stands for the robot is widened, one after the other, while no way is found for it [m]."""
SWIVEL, INSET = 0.07, 0.06
"""Of casters that swing round, as most furniture has: resistance over their load while they stand across the motion
(bearing and scrub over the trail of an office caster), and how far from the corners they are [m]."""
SPARE = 0.03
"""By so much a thing keeps away from where a force set in on its way [m]."""
SPACING = 0.5
"""Between points of a region that is to be opened [m]."""


class Thoughts:
    """Answers jobs, one after the other.

    Args:
        recorded: what learning and diagnosis are given.
        settings: of planning.
        fit: of learning, None: `LEARNING`; objects and seed are a job's.
        diagnosis: of what a model leaves out; likewise.
    """

    def __init__(
        self,
        recorded: Recorded,
        settings: NamoSettings | None = None,
        fit: FitOptions | None = None,
        diagnosis: DiagnoseOptions | None = None,
    ) -> None:
        self._recorded = recorded
        self._settings = settings or NamoSettings()
        self._fit, self._diagnosis = fit or LEARNING, diagnosis or DiagnoseOptions()

    def __call__(self, job: Job) -> Answer:
        """Return the answer to a job.

        Raises:
            NamoError: a scene cannot be planned in.
            ControlError: an outline or pose is none.
        """
        if isinstance(job, PlanJob):
            return self.plan(job)
        if isinstance(job, GraspJob):
            return find_grasp(job)
        if isinstance(job, MismatchJob):
            return self.diagnose(job)
        return self.learn(job)

    def plan(self, job: PlanJob) -> PlanAnswer:
        """Say what to move first, or give the way to the goal."""
        begun = time.perf_counter()
        beliefs, way = _beliefs(job, self._settings), None
        settings = self._settings
        first = found = plan(job.scene, beliefs, job.seed, settings, job.been)
        for wider in WIDER:
            if wider > 0.0:
                settings = _wider(job.scene, settings, wider)
                found = plan(job.scene, beliefs, job.seed, settings, job.been)
            if not found.drive:
                break
            # A disc that gets through says nothing of the turns that a longer robot has to make on its way.
            try:
                way = find_way(job.scene, job.seed)
                break
            except NamoError:
                continue
        chosen, move = None if way is not None else found.chosen, None
        if chosen is not None and chosen.plan is not None:
            opening = chosen.opening
            targets = np.zeros((0, 2)) if chosen.plan.aside else _targets(found, chosen.plan, opening.end)
            move = _move(chosen.plan, opening.start, opening.end, targets, opening.then)
        return PlanAnswer(
            move,
            way,
            "" if way is not None or move is not None else _reason(first, found),
            -1 if found.start is None else found.start,
            len(found.free.regions),
            found.cut_off,
            _choices(found),
            time.perf_counter() - begun,
        )

    def learn(self, job: LearnJob) -> Answer:
        """Say what an object's physics is like, from all that was recorded while it was held."""
        begun = time.perf_counter()
        try:
            recording = self._recorded(job.begin, job.end)
            options = self._fit.model_copy(update={"objects": (job.object,), "seed": job.seed})
            found = fit_recording(recording, options).objects[job.object]
            posterior = found.posterior.thinned(KEPT_DRAWS, np.random.default_rng(job.seed)).canonical()
            belief = belief_of_draws(_movable(recording, job.object), posterior.names, posterior.flat)
        except (BagError, ModelError, NamoError) as error:
            return Refused(_line(error))
        met = _met(recording, job.object)
        unexplained = [note for note in found.notes if note.startswith(_faults(found))]
        unexplained += [] if met is None else [f"it {met.told()}"]
        belief = replace(belief, stops=_stops(job))
        return LearnAnswer(belief, not unexplained, "; ".join(unexplained), time.perf_counter() - begun)

    def diagnose(self, job: MismatchJob) -> Answer:
        """Say what the model leaves out; the belief has the body's own parameters as they are with that in it."""
        begun = time.perf_counter()
        try:
            recording = self._recorded(job.begin, job.end)
            met = _met(recording, job.object)
            if met is not None:
                belief = self._before(recording, job, met.time)
                return MismatchAnswer(_stopped(belief, job, met), f"it {met.told()}", time.perf_counter() - begun)
            options = self._diagnosis.model_copy(update={"objects": (job.object,), "seed": job.seed})
            found = diagnose(recording, options).objects[job.object]
            names = " and ".join(each.effect for each in found.effects)
            if not names:
                why = "nothing that the library knows explains it"
                return MismatchAnswer(None, why, time.perf_counter() - begun)
            row = found.repaired.row
            known = [name for name in KERNEL_COLUMNS if name in COLUMN and np.isfinite(row[COLUMN[name]])]
            draws = np.array([[row[COLUMN[name]] for name in known]])
            belief = replace(belief_of_draws(_movable(recording, job.object), known, draws), stops=_stops(job))
        except (BagError, ModelError, MismatchError, NamoError) as error:
            return Refused(_line(error))
        return MismatchAnswer(belief, names, time.perf_counter() - begun)

    def _before(self, recording: Recording, job: MismatchJob, until: float) -> ObjectBelief:
        """Return what an object is like by what was felt before it met something; without that, as any is."""
        movable = _movable(recording, job.object)
        try:
            free = between(recording, job.begin - BEFORE, until)
            options = self._fit.model_copy(update={"objects": (job.object,), "seed": job.seed})
            posterior = fit_recording(free, options).objects[job.object].posterior
            drawn = posterior.thinned(KEPT_DRAWS, np.random.default_rng(job.seed)).canonical()
            return belief_of_draws(movable, drawn.names, drawn.flat)
        except (BagError, ModelError, NamoError):  # it moved too little until then
            return unlearned(movable, self._settings)


def _met(recording: Recording, name: str) -> Encounter | None:
    """Return what an object met on its way; None as well where that cannot be asked, because it hardly moved."""
    try:
        return find_encounter(recording, name)
    except (BagError, ModelError, MismatchError):
        return None


def _stops(job: LearnJob) -> tuple[Stop, ...]:
    """Return what an object has met before."""
    return job.belief.stops if isinstance(job.belief, ObjectBelief) else ()


def _stopped(belief: ObjectBelief, job: LearnJob, met: Encounter) -> ObjectBelief:
    """Return a belief of an object that does not go again where it met something."""
    stop = Stop(met.point, -met.direction, 0.0)
    level = float(stop.beyond(met.begun)) - SPARE
    return replace(belief, stops=(*_stops(job), replace(stop, level=level)))


LEFT_OUT, UNEXPLAINED = "something that this model class does not have", "no parameters that the prior allows explain"
"""How notes of a fit begin that say that it leaves a force out, or does not explain the motion."""
MATTERS = 0.25
"""Share of the greatest force on a thing, from which on a force that its model leaves out matters: a push is stopped at
half as much again as is expected. Casters that are dragged leave out a tenth."""


def _faults(found: ObjectFit) -> tuple[str, ...]:
    """Return how those notes of a fit begin that are a reason to ask what it leaves out."""
    felt = max(float(np.hypot(*motion.wrench[:, :2].T).max()) for motion in found.motions)
    left_out = float(np.median(found.noise[..., 1]))
    return (UNEXPLAINED, LEFT_OUT) if left_out > MATTERS * felt else (UNEXPLAINED,)


def _wider(scene: NamoScene, settings: NamoSettings, wider: float) -> NamoSettings:
    """Return settings with a disc that is wider [m]."""
    regions = settings.regions
    radius = drive_radius(scene.robot, regions.margin) if regions.radius is None else regions.radius
    return settings.model_copy(update={"regions": regions.model_copy(update={"radius": radius + wider})})


def _reason(first: NamoPlan, last: NamoPlan) -> str:
    """Say why nothing is moved and no way is driven."""
    if first is last and not first.drive:
        return first.reason
    why = "" if last.drive else f"; {last.reason}"
    return f"the floor is free as far as the goal, but not wide enough for the robot's turns{why}"


def _beliefs(job: PlanJob, settings: NamoSettings) -> dict[str, ObjectBelief]:
    """Return what is believed of everything movable: learned, or what such furniture is like."""
    learned = {name: belief for name, belief in job.beliefs.items() if isinstance(belief, ObjectBelief)}
    return {name: learned.get(name) or unlearned(thing, settings) for name, thing in job.scene.movable.items()}


def unlearned(thing: Movable, settings: NamoSettings) -> ObjectBelief:
    """Return what is believed of a thing before it was moved; the same each time."""
    return prior_belief(thing, np.random.default_rng(0), settings.beliefs)


def _move(found: ManipulationPlan, start: int, end: int, targets: Array, then: tuple[str, ...]) -> Move:
    """Return a manipulation plan as the executive carries it out."""
    return Move(
        found.object,
        tuple((np.asarray(motion.twist), float(motion.duration)) for motion in found.motions),
        np.mean(list(found.contacts.values()), axis=0),
        start,
        end,
        targets,
        then,
        found.highest_force,
        replace(found.model, casters=_casters(np.asarray(found.model.footprint))),
        str(found.model_class),
        hands=found.sides,
        more=found.more,
        pushes=found.pushes,
    )


def _casters(footprint: Array) -> SwivelCasters:
    """Return casters under the corners of the smallest rectangle about an outline (k, 2), where they may stand."""
    around = shapely.Polygon(footprint).minimum_rotated_rectangle
    corners = np.array(around.exterior.coords)[:-1]
    middle = corners.mean(axis=0)
    reach = np.hypot(*(corners - middle).T)[:, None]
    places = middle + (corners - middle) * np.maximum(1.0 - math.sqrt(2.0) * INSET / reach, 0.5)
    return SwivelCasters(places, SWIVEL, 1.0 / len(places))


def _targets(found: NamoPlan, chosen: ManipulationPlan, end: int) -> Array:
    """Return points (k, 2) of the region to be opened: where the plan leads to, and some all over it [m]."""
    region = found.free.regions[end]
    low_x, low_y, high_x, high_y = region.bounds
    x, y = np.meshgrid(np.arange(low_x, high_x, SPACING), np.arange(low_y, high_y, SPACING))
    points = np.column_stack([x.ravel(), y.ravel()])
    inside = points[shapely.contains_xy(region, points[:, 0], points[:, 1])]
    return np.concatenate([np.asarray(chosen.target)[None], inside])


def _choices(found: NamoPlan) -> tuple[Choice, ...]:
    """Return the openings that were looked at, with their values."""
    if found.policy is None:
        return ()
    return tuple(
        Choice(opening.object, opening.start, opening.end, made.probability, float(value))
        for opening, made, value in zip(found.openings, found.estimates, found.policy.q, strict=True)
        if made is not None
    )


def _movable(recording: Recording, name: str) -> Movable:
    body = recording.bodies[name]
    return Movable(np.asarray(body.footprint), mass=float(body.nominal_mass))


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
