"""The one manipulation that is then done, before anybody knows which world it is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pbrl_control.planar import Array, compose
from pbrl_namo.manipulation.effort_kernel import PEAK
from pbrl_namo.manipulation.grasps import Grasp
from pbrl_namo.manipulation.plan import ManipulationPlan, Motion
from pbrl_namo.manipulation.plane_kernel import moved
from pbrl_namo.manipulation.policies import TURNS, centre_of
from pbrl_namo.manipulation.settings import ManipulationSettings
from pbrl_namo.manipulation.ways_to_move import WaysToMove
from pbrl_namo.manipulation.worlds import Worlds

Flags = NDArray[np.bool_]


def best_plan(
    grasps: Sequence[Grasp],
    pose: Array,
    name: str,
    target: Array,
    worlds: Worlds,
    ways: WaysToMove,
    taken: Array,
    rewards: Array,
    works: Flags,
    settings: ManipulationSettings,
) -> ManipulationPlan:
    """Return the manipulation that does best over all worlds, where it fails costing as much as the dearest.

    Args:
        grasps: of the thing.
        pose: (3,) of it in `world` [m, rad].
        name: of it.
        target: (2,) in `world`, to which a way is to be open [m].
        worlds: it may be in.
        ways: p manipulations.
        taken: (w, p, 5) what each takes in each world.
        rewards: (w, p) of each.
        works: (w, p) which are possible; some are.
        settings: of Monte-Carlo manipulation.
    """
    cost = settings.cost
    p = int(np.argmax(np.where(works, cost.terminal + rewards, -cost.alpha).mean(axis=0)))
    grasp, end = grasps[ways.grasps[p]], np.array(pose, dtype=float)
    motions = []
    for k, command in enumerate(ways.motions[p]):
        if command >= 0:
            unit, speed, way = ways.commands.twists[command], float(ways.speeds[p, k]), float(ways.went[p, k])
            moved(end.copy(), unit, way, end)
            centre = centre_of(unit) if abs(unit[2]) > TURNS else None
            motions.append(Motion(speed * unit, way / speed, centre))
    good = np.flatnonzero(works[:, p])
    peaks = taken[good, p, PEAK]
    kinds = Counter(worlds.freedoms[w].model_class for w in good)
    return ManipulationPlan(
        object=name,
        sides=grasp.sides,
        contacts=grasp.contacts,
        drive_to=compose(pose, grasp.leave),
        stand=compose(pose, grasp.base),
        motions=tuple(motions),
        end=compose(end, np.zeros(3)),
        target=target,
        expected_force=float(peaks.mean()),
        highest_force=float(peaks.max()),
        works=float(works[:, p].mean()),
        reward=float(rewards[good, p].mean()),
        model_class=kinds.most_common(1)[0][0],
        model=worlds.models[good[np.argsort(peaks, kind="stable")[(len(good) - 1) // 2]]],
    )
