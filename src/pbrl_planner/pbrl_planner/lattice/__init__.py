"""Lattice planner of thesis chapter 4: a robot, with or without a cart, among obstacles, within a bound of the best."""

from pbrl_planner.lattice.body import ArticulatedBody
from pbrl_planner.lattice.cfg_file import Environment, read_environment
from pbrl_planner.lattice.generator import GeneratorSettings, generate
from pbrl_planner.lattice.grid import CostGrid
from pbrl_planner.lattice.lattice import Lattice
from pbrl_planner.lattice.motions import Motions
from pbrl_planner.lattice.mprim_file import read_primitives, write_primitives
from pbrl_planner.lattice.plan import Improvement, LatticePlan
from pbrl_planner.lattice.planner import plan
from pbrl_planner.lattice.primitives import Pace, Primitive, PrimitiveSet
from pbrl_planner.lattice.problem import LatticeProblem
from pbrl_planner.lattice.ros_map import read_map
from pbrl_planner.lattice.settings import LatticeSettings
from pbrl_planner.lattice.warm_up import warm_up

__all__ = [
    "ArticulatedBody",
    "CostGrid",
    "Environment",
    "GeneratorSettings",
    "Improvement",
    "Lattice",
    "LatticePlan",
    "LatticeProblem",
    "LatticeSettings",
    "Motions",
    "Pace",
    "Primitive",
    "PrimitiveSet",
    "generate",
    "plan",
    "read_environment",
    "read_map",
    "read_primitives",
    "warm_up",
    "write_primitives",
]
