"""How openings are looked for, and what moving a thing costs (thesis 6.2.1, 6.3.2)."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from pbrl_control.constraints.classes import ConstraintSettings
from pbrl_control.grasping.settings import GraspSettings
from pbrl_control.settings import NotNegative, Positive, Section


class MotionSettings(Section):
    """How a held thing is moved, and how far.

    Attributes:
        speed: [m/s] of the base, and of the thing's origin.
        yaw_rate: [rad/s]
        acceleration: [m/s^2] with which it sets out.
        yaw_acceleration: [rad/s^2]
        way: [m] most that the thing's centre is carried straight on.
        turn: [rad] most that it is turned.
        step: [m] that no point of thing or robot goes further between two looks for a collision.
        look: steps between two looks for an opening.
        chord: [rad] of an arc that is taken as straight.
        clearance: [m] that thing and robot keep from all else; what is nearer at the start must not come nearer.
        spare: [m] by which an opening is to be wider than the disc that has to pass.
        sideways: [m] that the base can be carried sideways, which it cannot drive: arms and shunting make up for it.
        sideways_forward: [m] of that more for each metre forward meanwhile.
        sideways_backward: [m] in place of `sideways` while the base goes backward. The three are fitted to the angles
            by which Krang turned a held table about six points (`./pbrl experiment articulation`), within 1 cm.
    """

    speed: Positive = 0.1
    yaw_rate: Positive = 0.2
    acceleration: Positive = 0.15
    yaw_acceleration: Positive = 0.2
    way: Positive = 3.0
    turn: Positive = 2.2
    step: Annotated[float, Field(gt=0.0, le=0.05)] = 0.025
    look: Annotated[int, Field(ge=1, le=20)] = 2
    chord: Annotated[float, Field(gt=0.0, le=0.2)] = 0.1
    clearance: NotNegative = 0.02
    spare: NotNegative = 0.03
    sideways: Positive = 0.53
    sideways_forward: NotNegative = 0.45
    sideways_backward: Positive = 0.43


class CostSettings(Section):
    """Equation 41.

    Attributes:
        alpha: what one manipulation costs at most; 25 as in the thesis, which writes 200 / 4 and means an eighth.
        beta: steepness.
        time: [s] nominal maximum of a manipulation's duration.
        force: [N s] nominal maximum of the sum of the grips' forces over time.
        torque: [N m s] nominal maximum of the sum of the grips' torques over time.
        terminal: worth of the region reached, where plans of one opening are compared; the policy has its own.
    """

    alpha: Positive = 25.0
    beta: Positive = 10.0
    time: Positive = 40.0
    force: Positive = 2500.0
    torque: Positive = 250.0
    terminal: Positive = 200.0


class ManipulationSettings(Section):
    """Monte-Carlo manipulation.

    Attributes:
        worlds: sampled for each thing (k of equation 40).
        commands: object velocities that are tried at most, those first that most worlds ask for.
        grasps: that are tried at most.
        apart: [m] between the contacts of two grasps.
        same_angle: [rad] between directions that count as one command.
        same_point: [m] between centres of turns that do.
        refused: share of a command's speed that a world's constraints may refuse before it counts as stuck.
        cell: [m] of the grid on which the way is found that an opening has to restore.
        second_look: where no policy opens a way for a thing that is free to move, look for two motions, one after the
            other, of those that the base can do with it.
        second_grasps: that are tried then.
        radii: [m] of arcs that the base drives then.
        stops: shares of how far the first motion goes, at which the second may begin.
        enough: places from which a second motion opens a way, at which the search ends.
        steps: manipulations of one thing, with a grasp each, that an opening may take; 1: never more than one.
        step_places: poses of the thing from which a further step is looked for.
        step_grasps: that are tried at each of them.
        step_spacing: [m] between those along a face.
        pushing: where nothing else helps, let a held thing push others before it.
        motion: how a held thing is moved.
        cost: of that.
        constraints: what counts as a constraint, and what the robot exerts at most.
        grasping: what the grippers can do.
    """

    worlds: Annotated[int, Field(ge=1, le=1000)] = 40
    commands: Annotated[int, Field(ge=1, le=200)] = 24
    grasps: Annotated[int, Field(ge=1, le=100)] = 12
    apart: NotNegative = 0.12
    same_angle: Positive = 0.12
    same_point: Positive = 0.06
    refused: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.12
    cell: Annotated[float, Field(gt=0.0, le=0.1)] = 0.025
    second_look: bool = True
    second_grasps: Annotated[int, Field(ge=1, le=100)] = 4
    radii: tuple[Positive, ...] = (0.8, 1.6)
    stops: Annotated[tuple[Positive, ...], Field(min_length=1)] = (1.0, 0.5)
    enough: Annotated[int, Field(ge=1)] = 2
    steps: Annotated[int, Field(ge=1, le=10)] = 4
    step_places: Annotated[int, Field(ge=1)] = 16
    step_grasps: Annotated[int, Field(ge=1, le=100)] = 8
    step_spacing: Positive = 0.15
    pushing: bool = False
    motion: MotionSettings = MotionSettings()
    cost: CostSettings = CostSettings()
    constraints: ConstraintSettings = ConstraintSettings()
    grasping: GraspSettings = GraspSettings()
