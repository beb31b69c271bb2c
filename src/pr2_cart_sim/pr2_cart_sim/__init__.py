"""The PR2 with a utility cart among people in an office, in Bullet; sim_node."""

from pr2_cart_sim.errors import Pr2Error
from pr2_cart_sim.maps import GridMap, load_map, save_map
from pr2_cart_sim.messages import to_messages
from pr2_cart_sim.observations import Observation
from pr2_cart_sim.postures import POSTURES, Posture, posture
from pr2_cart_sim.robot import PR2
from pr2_cart_sim.scene import OfficeScene, load_office
from pr2_cart_sim.session import Pr2Session

__all__ = [
    "POSTURES",
    "PR2",
    "GridMap",
    "Observation",
    "OfficeScene",
    "Posture",
    "Pr2Error",
    "Pr2Session",
    "load_map",
    "load_office",
    "posture",
    "save_map",
    "to_messages",
]
