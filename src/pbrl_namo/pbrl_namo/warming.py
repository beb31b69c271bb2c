"""Compiling ahead: numba compiles each kernel when it is first called, and no robot should wait for that."""

from __future__ import annotations

import math

import numpy as np

from pbrl_bag.types import Recording
from pbrl_control.constraints.object_model import ObjectModel
from pbrl_mismatch.options import DiagnoseOptions
from pbrl_model.fitting.options import FitOptions
from pbrl_model.online.rehearsal import WINDOW, made_up_push
from pbrl_model.parameters import BodyParameters
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import GraspJob, LearnJob, MismatchJob, PlanJob
from pbrl_namo.executive.ways import find_grasp, find_way
from pbrl_namo.manipulation.contact_worlds import ContactWorlds
from pbrl_namo.manipulation.pushing_through import WORLDS
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.scene import Movable, NamoScene
from pbrl_namo.thinking import Thoughts

Corners = list[tuple[float, float]]
SQUARE: Corners = [(-0.4, -0.4), (0.4, -0.4), (0.4, 0.4), (-0.4, 0.4)]
LONG: Corners = [(-0.375, -0.75), (0.375, -0.75), (0.375, 0.75), (-0.375, 0.75)]

HELD_AT = np.array([-1.1, 0.0, 0.0])
"""Of the base in the square table's frame, who holds it [m, rad]."""


def compile_kernels() -> None:
    """Plan in a small room, find a grasp and a way there: whatever planning calls is compiled, or loaded, after this.

    Some tens of seconds on a machine that has never planned, half a second later on.
    """
    room = np.array([(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)])
    movable = {"square": Movable(np.array(SQUARE), mass=33.0), "long": Movable(np.array(LONG), mass=38.0)}
    poses = {"square": np.array([3.0, 0.85, 0.0]), "long": np.array([3.0, 2.8, 0.0])}
    start, goal = np.array([0.9, 2.0, 0.0]), np.array([5.2, 2.0, math.nan])
    scene = NamoScene.of(room, {}, movable, poses, start, goal)
    pinned = BodyParameters(mass=38.0, wheel_x=0.3, wheel_y=0.65, mu_x=0.25, mu_y=0.25, mu_ground=0.02)
    stuck = BodyParameters(mass=300.0, mu_x=0.9, mu_y=0.9, mu_ground=0.9)
    known = {
        name: ObjectBelief(movable[name].footprint, parameters.to_vector()[None])
        for name, parameters in {"square": stuck, "long": pinned}.items()
    }
    thoughts = Thoughts(_nothing)
    for beliefs in ({}, known):
        answer = thoughts.plan(PlanJob(scene, beliefs, {}, 1))
        if answer.move is not None:
            find_grasp(GraspJob(scene, answer.move, (), 1))
    models = [ObjectModel.uniform(pinned, np.array(LONG))] * WORLDS
    ContactWorlds(scene, "square", {"long": models}, ManipulationSettings()).carry(
        HELD_AT, [(np.array([0.1, 0.0, 0.0]), 2.0)]
    )
    try:
        find_way(NamoScene.of(room, {}, {}, {}, start, goal), 1)
    except NamoError:
        return


def compile_learning() -> None:
    """Learn and diagnose a made-up push: whatever that calls is compiled, or loaded, after this.

    Two minutes on a machine that has never learned, ten seconds later on.
    """
    recording = made_up_push()
    fit = FitOptions(window=WINDOW, search_draws=10, draws=5, holdout_share=0.5)
    few = {"draws": 8, "candidates": 1, "shortlist": 1, "keep": (1,), "iterations": (1,), "survivors": ()}
    diagnosis = DiagnoseOptions(windows=(WINDOW,), block=WINDOW, every=2, **few)
    thoughts = Thoughts(lambda begin, end: recording, fit=fit, diagnosis=diagnosis)
    (thing,), end = recording.bodies, recording.grasps[0].end
    thoughts.learn(LearnJob(thing, 0.0, end, None, 0))
    thoughts.diagnose(MismatchJob(thing, 0.0, end, None, 0))


def _nothing(begin: float, end: float) -> Recording:
    raise NamoError(f"recording: nothing was recorded between {begin} and {end} s")
