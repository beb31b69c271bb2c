"""Which grasps of an object are driven to: those a plan tells, or those its model class allows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from pbrl_control.constraints.classes import Freedom, ModelClass
from pbrl_control.grasp_plan import GraspPlan
from pbrl_control.grasping import EVERY_HAND, GraspModel, GraspSearch, GraspSettings, grasps_at, sample_grasps
from pbrl_control.grasping.contacts import Hands
from pbrl_control.navigation import FloorMap
from pbrl_control.percept import BodyShape
from pbrl_control.planar import Array


def grasp_model(freedom: Freedom) -> GraspModel:
    """Return what grasping has to know of what an object is free to do."""
    kind = freedom.model_class
    if kind == ModelClass.FIXED_POINT:
        return GraspModel(kind, anchor=freedom.anchor)
    if kind == ModelClass.ANISOTROPIC:
        vx, vy, _ = freedom.moves[0]  # the translation comes first
        return GraspModel(kind, free_axis=math.atan2(vy, vx))
    return GraspModel(kind)


class GraspChoice(Protocol):
    """A way to come by grasps."""

    def search(
        self,
        name: str,
        shape: BodyShape,
        pose: Array,
        base: Array,
        floor: FloorMap,
        rng: np.random.Generator,
        settings: GraspSettings,
    ) -> GraspSearch:
        """Return grasps of an object with ways to them, shortest first.

        Args:
            name: of the object.
            shape: its footprint and height.
            pose: (3,) of it in `world` [m, rad].
            base: (3,) where the base is, in `world`.
            floor: room and obstacles.
            rng: of every draw.
            settings: of grippers and search.

        Raises:
            ControlError: a pose is not finite, the object is not on the map.
        """
        ...


class GivenGrips:
    """The grips of a plan and no others.

    Args:
        plan: that has them.
    """

    def __init__(self, plan: GraspPlan) -> None:
        self._points: Mapping[str, Array] = {grip.gripper: np.array(grip.point) for grip in plan.grips}

    def search(
        self,
        name: str,
        shape: BodyShape,
        pose: Array,
        base: Array,
        floor: FloorMap,
        rng: np.random.Generator,
        settings: GraspSettings,
    ) -> GraspSearch:
        """See `GraspChoice.search`."""
        return grasps_at(name, shape, pose, self._points, base, floor, rng, settings=settings)


class SampledGrasps:
    """Grasps sampled by model class (thesis 6.3.2, figure 39).

    Args:
        model: how the object can move; None: nobody knows, and every face will do.
        hands: which hands to try.

    Attributes:
        model: as last learned; what it is when a way is planned counts.
    """

    def __init__(self, model: GraspModel | None = None, hands: Sequence[Hands] = EVERY_HAND) -> None:
        self.model = model
        self._hands = tuple(hands)

    def search(
        self,
        name: str,
        shape: BodyShape,
        pose: Array,
        base: Array,
        floor: FloorMap,
        rng: np.random.Generator,
        settings: GraspSettings,
    ) -> GraspSearch:
        """See `GraspChoice.search`."""
        model = self.model or GraspModel("unconstrained")
        return sample_grasps(name, shape, pose, model, base, floor, rng, hands=self._hands, settings=settings)
