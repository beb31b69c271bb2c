"""Messages of navigation among movable obstacles to library types and back; plain functions, no node needed."""

from __future__ import annotations

import math

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose2D, PoseStamped
from pbrl_msgs.msg import Body, ObjectModel, Scene
from pbrl_msgs.msg import NamoStatus as NamoStatusMsg

from pbrl_control.planar import Array, yaw_of
from pbrl_model.ros.conversions import posterior_from_msg
from pbrl_namo.beliefs.belief import ObjectBelief, belief_of_draws
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.account import Account
from pbrl_namo.executive.mission import checked_goal
from pbrl_namo.executive.report import NamoStatus
from pbrl_namo.scene import Movable

WORLD = "world"
"""The frame of goals and of everything that is drawn."""

KEPT_DRAWS = 400
"""Of a posterior that others have learned; so many tell shares to a few per cent."""

UNIT = 0.01
"""By so much the length of a goal's quaternion may differ from one."""


def status_to_msg(status: NamoStatus, account: Account, stamp: Time) -> NamoStatusMsg:
    """Return what is told of an executive.

    Args:
        status: of the moment.
        account: of the same goal.
        stamp: of the message.
    """
    entered = {state: time for state, time in status.seconds.items() if time > 0.0 or state == status.state}
    message = NamoStatusMsg(
        state=str(status.state),
        sentence=status.sentence,
        finished=status.finished,
        success=status.success,
        goal=Pose2D(x=float(status.goal[0]), y=float(status.goal[1]), theta=float(status.goal[2])),
        object=status.object,
        region=status.region,
        target_region=status.target,
        regions=status.regions,
        cut_off=list(status.cut_off),
        opening_object=[choice.object for choice in status.choices],
        opening_from=[choice.start for choice in status.choices],
        opening_to=[choice.end for choice in status.choices],
        opening_probability=[float(choice.probability) for choice in status.choices],
        opening_value=[float(choice.value) for choice in status.choices],
        expected_force=float(status.expected_force),
        force_limit=float(status.force_limit),
        felt_force=float(status.felt_force),
        plans=account.plans,
        surprises=account.surprises,
        updates=account.updates,
        repairs=account.repairs,
        openings=account.openings,
        planning_seconds=float(account.planning_seconds),
        learning_seconds=float(account.learning_seconds),
        state_names=[str(state) for state in entered],
        state_seconds=[float(time) for time in entered.values()],
        notes=list(status.notes),
    )
    message.header.stamp, message.header.frame_id = stamp, WORLD
    return message


def goal_from_pose2d(message: Pose2D) -> Array:
    """Return a goal (3,) in `world`; a heading of NaN: any [m, rad].

    Raises:
        NamoError: it is no place.
    """
    return checked_goal(np.array([message.x, message.y, message.theta]))


def goal_from_pose(message: PoseStamped) -> Array:
    """Return the goal (3,) in `world` that a person has drawn in RViz [m, rad].

    Raises:
        NamoError: it is in another frame, or no pose.
    """
    frame = message.header.frame_id
    if frame != WORLD:
        raise NamoError(f"goal: expected it in frame {WORLD!r}, got {frame!r}; make {WORLD!r} RViz's fixed frame")
    p, q = message.pose.position, message.pose.orientation
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not abs(length - 1.0) < UNIT:
        raise NamoError(f"goal: expected a quaternion of length 1, got length {length:.3g}")
    return checked_goal(np.array([p.x, p.y, yaw_of(np.array([q.x, q.y, q.z, q.w]))]))


def goal_from_text(text: str) -> Array:
    """Return the goal (3,) that a text "x y" or "x y theta" names [m, rad]; without a heading any will do.

    Raises:
        NamoError: it has another form.
    """
    words = text.replace(",", " ").split()
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) not in (2, 3):
        raise NamoError(f'goal: expected "x y" or "x y theta" [m, rad], got {text!r}')
    return checked_goal(np.array([*numbers, math.nan][:3]))


def masses_from_msg(message: Scene) -> dict[str, float]:
    """Return what each body is said to weigh [kg], by name; NaN where nobody says."""
    return {body.name: float(body.nominal_mass) for body in message.bodies}


def movable_from_msg(body: Body) -> Movable:
    """Return what is seen of a thing that may be moved."""
    footprint = np.array([[point.x, point.y] for point in body.footprint])
    return Movable(footprint, float(body.height), float(body.nominal_mass))


def belief_from_msg(message: ObjectModel, scene: Scene) -> ObjectBelief | None:
    """Return what others have learned of an object; None where the scene has no such thing that may be moved.

    Args:
        message: draws of its parameters.
        scene: that tells its outline.

    Raises:
        ModelError: a name is unknown, a unit is another, or the lengths do not fit.
        NamoError: a draw is not physical.
    """
    bodies = [body for body in scene.bodies if body.name == message.object and body.movable]
    if not bodies:
        return None
    posterior = posterior_from_msg(message).thinned(KEPT_DRAWS, np.random.default_rng(0))
    return belief_of_draws(movable_from_msg(bodies[0]), posterior.names, posterior.flat)
