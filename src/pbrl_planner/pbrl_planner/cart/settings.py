"""Everything that planner, costmaps, local controller and navigator of a cart can be told, in one file."""

from __future__ import annotations

from pathlib import Path

from pbrl_control.cart import CartSettings
from pbrl_control.installed import params_folder
from pbrl_control.settings import Positive, Section, load_section
from pbrl_planner.costmap import CostmapSettings
from pbrl_planner.lattice import LatticeSettings


class NavigationSettings(Section):
    """When to plan again, and when to give up.

    Attributes:
        blocked: [s] before something that is in the way after which a way round it is looked for.
        retry: [s] between two calls of the planner of which the first found nothing; twice as long after each more.
        retry_most: [s] between two calls at most.
        unseen: [s] after which something that nobody has seen since is taken to be gone, where it leaves no path.
        refresh: [s] on one path after which a better one is looked for, from a place ahead on it: the floor is better
            known by then.
        make_way: [s] without a path after which robot and cart go back along where they came: who stands in the way may
            be shut in by them.
        way_back: how far they go back [m].
        room: [s] that they wait there; without a path after twice that they go back further.
        give_up: [s] without a path after which the goal is given up: people leave, walls do not.
    """

    blocked: Positive = 2.0
    retry: Positive = 2.0
    retry_most: Positive = 6.0
    unseen: Positive = 5.0
    refresh: Positive = 15.0
    make_way: Positive = 45.0
    way_back: Positive = 2.5
    room: Positive = 8.0
    give_up: Positive = 120.0


class CartParameters(Section):
    """One file for the nodes that push a cart.

    Attributes:
        planner: epsilons and patience of the lattice planner.
        controller: limits, gains, distances, patience of the local controller.
        local_costmap: around the robot; what the controller looks at.
        global_costmap: over the whole map; what is planned on. Its width and height are the map's.
        navigation: when to plan again.
    """

    planner: LatticeSettings = LatticeSettings()
    controller: CartSettings = CartSettings()
    local_costmap: CostmapSettings = CostmapSettings()
    global_costmap: CostmapSettings = CostmapSettings()
    navigation: NavigationSettings = NavigationSettings()


def load_cart(path: str | Path = "") -> CartParameters:
    """Read what a cart is pushed with.

    Args:
        path: of the YAML file; empty: `cart.yaml` as installed.

    Raises:
        ControlError: there is no such file, or it is not as it should be.
    """
    return load_section(Path(path) if path else params_folder("settings") / "cart.yaml", CartParameters, "settings")
