"""Golem Krang in Bullet, with furniture on casters; sim_node."""

from krang_sim.errors import KrangError
from krang_sim.grippers import GraspOutcome
from krang_sim.messages import to_messages
from krang_sim.observations import Observation
from krang_sim.postures import POSTURES, Posture, posture
from krang_sim.robot import Krang
from krang_sim.session import KrangSession

__all__ = [
    "POSTURES",
    "GraspOutcome",
    "Krang",
    "KrangError",
    "KrangSession",
    "Observation",
    "Posture",
    "posture",
    "to_messages",
]
