"""A probabilistic roadmap over the free space, with grasps among its milestones (thesis 6.2.1).

Milestones are drawn uniformly and before the faces of everything movable, and OMPL's PRM connects near ones where the
disc can drive straight. A roadmap by itself can only miss connections. Here each milestone knows its exact region, an
edge that would leave it is refused, and what sampling has left in pieces (a narrow passage) or without a milestone is
sewn up along a triangulation of the region. So components and regions that are large enough correspond one to one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from pbrl_control.grasping.candidates import EVERY_HAND
from pbrl_control.grasping.contacts import Hands
from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.regions.free_space import FreeSpace, Indices, drive_radius, free_space
from pbrl_namo.regions.grasps import Stands, free_stands, join_stands, sample_stands
from pbrl_namo.regions.prm import connect_milestones
from pbrl_namo.regions.settings import RegionSettings
from pbrl_namo.regions.sewing import ways_through
from pbrl_namo.scene import NamoScene

ROUNDS = 20
"""Draws from a region's box before its own middle is taken for a milestone."""


TOUCH = 1e-3
"""Distance [m] up to which a region counts as bordering a thing grown by the disc's radius."""


@dataclass(frozen=True)
class GraspSample:
    """Where the base can stand to grasp a thing.

    Attributes:
        object: name of the thing.
        point: (2,) where the base's middle stands, in `world` [m].
        contact: (2,) on the outline, in the thing's frame: of the gripper, or the middle between both [m].
        normal: of the outline there, outwards, in the thing's frame [rad].
        component: of the roadmap.
        heading: of the base, in `world` [rad].
        hands: who grasps.
    """

    object: str
    point: Array
    contact: Array
    normal: float
    component: int
    heading: float
    hands: Hands


@dataclass(frozen=True)
class Roadmap:
    """Milestones, edges between them, and grasps.

    Attributes:
        points: (n, 2) in `world` [m].
        component: (n,) of each milestone.
        edges: (m, 2) of milestones between which the disc can drive straight.
        regions: (c,) of each component: the region of the free space that it is in.
        grasps: of each movable thing, where the base can stand for it; empty where it cannot.
        radius: of the disc [m].
    """

    points: Array
    component: Indices
    edges: Indices
    regions: Indices
    grasps: Mapping[str, tuple[GraspSample, ...]]
    radius: float

    def grasp_regions(self, name: str) -> frozenset[int]:
        """Return the regions from which a thing can be grasped.

        Raises:
            NamoError: the roadmap was made for another scene.
        """
        if name not in self.grasps:
            raise NamoError(f"roadmap: expected one made with {name!r} in the scene, got one without; build it again")
        return frozenset(int(self.regions[grasp.component]) for grasp in self.grasps[name])


def build_roadmap(scene: NamoScene, rng: np.random.Generator, settings: RegionSettings | None = None) -> Roadmap:
    """Build the roadmap of a scene.

    Args:
        scene: things where they stand.
        rng: draws milestones and grasps; same state, same roadmap.
        settings: of density, reach and grasps.
    """
    settings = settings or RegionSettings()
    radius = drive_radius(scene.robot, settings.margin) if settings.radius is None else settings.radius
    free = free_space(scene, radius)
    drawn, drawn_region = _milestones(scene, free, rng, settings)
    stands, stand_region = _grasp_milestones(scene, free, rng, settings)
    points = np.concatenate((drawn, stands.poses[:, :2]))
    region = np.concatenate((drawn_region, stand_region))
    edges = connect_milestones(free, points, rng.permutation(len(points)), settings.neighbours)
    more, links, more_region = _sew(free, points, region, edges)
    points, region = np.concatenate((points, more)), np.concatenate((region, more_region))
    edges = np.concatenate((edges, links))
    component, regions = _components(region, edges)
    grasps = _samples(stands, component[len(drawn) : len(drawn) + len(stands.thing)])
    return Roadmap(points, component, edges, regions, grasps, radius)


def _milestones(
    scene: NamoScene, free: FreeSpace, rng: np.random.Generator, settings: RegionSettings
) -> tuple[Array, Indices]:
    """Draw milestones (n, 2) uniformly, more where a region has too few, and return them with their regions (n,)."""
    low_x, low_y, high_x, high_y = scene.room.bounds
    count = int(np.ceil(settings.density * (high_x - low_x) * (high_y - low_y)))
    drawn = rng.uniform((low_x, low_y), (high_x, high_y), (count, 2))
    region = free.indices(drawn)
    points, found = [drawn[region >= 0]], [region[region >= 0]]
    have = np.bincount(found[0], minlength=len(free.regions))
    for number, polygon in enumerate(free.regions):
        missing = settings.least_milestones - int(have[number])
        if missing > 0 and polygon.area >= settings.least_area:
            more = _inside(polygon, missing, rng)
            points.append(more)
            found.append(np.full(len(more), number))
    return np.concatenate(points), np.concatenate(found)


def _inside(polygon: shapely.Polygon, count: int, rng: np.random.Generator) -> Array:
    """Draw points (count, 2) in a polygon; what its box does not give in some rounds is its middle, once."""
    low, high = np.reshape(polygon.bounds, (2, 2))
    kept = np.zeros((0, 2))
    for _ in range(ROUNDS):
        drawn = rng.uniform(low, high, (4 * count, 2))
        kept = np.concatenate((kept, drawn[shapely.contains_xy(polygon, *drawn.T)]))
        if len(kept) >= count:
            return kept[:count]
    return np.concatenate((kept, shapely.get_coordinates(polygon.point_on_surface())))


def _grasp_milestones(
    scene: NamoScene, free: FreeSpace, rng: np.random.Generator, settings: RegionSettings
) -> tuple[Stands, Indices]:
    """Draw grasps, and return those whose stands are free and in a region, with the regions (n,).

    There may be few places from which a thing can be grasped, none of which is drawn. So things that border a region
    without a grasp from there are looked at once more and finely: a region must not seem cut off for want of samples.
    """
    stands = sample_stands(scene, rng, settings)
    region = free.indices(stands.poses[:, :2])
    stands, region = _kept(stands, region, region >= 0, scene, settings)
    have = set(zip(stands.thing.tolist(), region.tolist(), strict=True))
    missing = {pair for pair in _bordering(scene, free) if pair not in have}
    more = sample_stands(scene, rng, settings, only={stands.objects[thing] for thing, _ in missing}, fine=True)
    more_region = free.indices(more.poses[:, :2])
    new = [pair in missing for pair in zip(more.thing.tolist(), more_region.tolist(), strict=True)]
    more, more_region = _kept(more, more_region, np.array(new, dtype=bool), scene, settings)
    return join_stands((stands, more)), np.concatenate((region, more_region))


def _kept(
    stands: Stands, region: Indices, wanted: NDArray[np.bool_], scene: NamoScene, settings: RegionSettings
) -> tuple[Stands, Indices]:
    """Return the stands (n,) that are wanted and free, with their regions."""
    stands, region = stands.take(wanted), region[wanted]
    free = free_stands(stands, scene, settings)
    return stands.take(free), region[free]


def _bordering(scene: NamoScene, free: FreeSpace) -> list[tuple[int, int]]:
    """Return which things (by their place in the scene) border which regions of the free space."""
    if not free.regions or not scene.movable:
        return []
    tree = shapely.STRtree(free.regions)
    outlines = np.array(list(scene.outlines.values()), dtype=object)
    return [(a, b) for a, b in tree.query(outlines, predicate="dwithin", distance=free.radius + TOUCH).T.tolist()]


def _sew(free: FreeSpace, points: Array, region: Indices, edges: Indices) -> tuple[Array, Indices, Indices]:
    """Connect what is in pieces though it is in one region.

    Returns:
        Further milestones (k, 2), edges (m, 2) to and between them, numbered after the given points, and regions (k,).
    """
    _, label = connected_components(_matrix(edges, len(points)), directed=False)
    more, links, more_region = [np.zeros((0, 2))], [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    total = len(points)
    for number, polygon in enumerate(free.regions):
        rows = np.flatnonzero(region == number)
        _, first = np.unique(label[rows], return_index=True)
        pieces = rows[np.sort(first)]
        if len(pieces) < 2:
            continue
        for end, way in zip(pieces[1:], ways_through(polygon, points[pieces[0]], points[pieces[1:]]), strict=True):
            names = [pieces[0], *range(total, total + len(way) - 2), end]
            more.append(way[1:-1])
            links.append(np.column_stack((names[:-1], names[1:])))
            more_region.append(np.full(len(way) - 2, number))
            total += len(way) - 2
    return np.concatenate(more), np.concatenate(links), np.concatenate(more_region)


def _components(region: Indices, edges: Indices) -> tuple[Indices, Indices]:
    """Return the component of each milestone (n,) and the region of each component (c,).

    Raises:
        NamoError: a component is in two regions, so an edge crosses something; that is a fault of the roadmap.
    """
    count, component = connected_components(_matrix(edges, len(region)), directed=False)
    regions = np.full(count, -1)
    regions[component] = region
    if (regions[component] != region).any():
        wrong = int(component[regions[component] != region][0])
        raise NamoError(f"roadmap: expected component {wrong} in one region, got it in two; an edge crosses something")
    return component.astype(np.int64), regions


def _matrix(edges: Indices, count: int) -> coo_matrix:
    """Return the adjacency matrix (count, count) of edges (m, 2)."""
    return coo_matrix((np.ones(len(edges), dtype=bool), (edges[:, 0], edges[:, 1])), shape=(count, count))


def _samples(stands: Stands, component: NDArray[np.int64]) -> dict[str, tuple[GraspSample, ...]]:
    """Return the grasps by thing."""
    found: dict[str, list[GraspSample]] = {name: [] for name in stands.objects}
    for row, thing in enumerate(stands.thing):
        name, pose = stands.objects[thing], stands.poses[row]
        sample = GraspSample(
            name,
            pose[:2],
            stands.contacts[row],
            float(stands.normals[row]),
            int(component[row]),
            float(pose[2]),
            EVERY_HAND[stands.hands[row]],
        )
        found[name].append(sample)
    return {name: tuple(samples) for name, samples in found.items()}
