"""The roadmap: what it connects can be driven, each region is one component, and stands are real grasps."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np
import pytest
import shapely
from region_cases import box, corridor, office, table

from pbrl_control.grasping.candidates import grasps_at
from pbrl_control.percept import BodyShape
from pbrl_control.planar import rotation, wrap
from pbrl_namo.errors import NamoError
from pbrl_namo.regions import RegionSettings, build_roadmap, free_space, openings
from pbrl_namo.regions.grasps import grasp_refusal
from pbrl_namo.regions.sewing import ways_through
from pbrl_namo.scene import Movable, NamoScene


@pytest.mark.parametrize("seed", range(4))
def test_every_edge_stays_in_the_free_space_and_every_region_is_one_component(seed: int) -> None:
    scene, settings = office(18, seed), RegionSettings()
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(seed))
    lines = shapely.linestrings(roadmap.points[roadmap.edges])
    things = shapely.union_all([*scene.fixed.values(), *scene.outlines.values()])
    assert shapely.distance(things, lines).min() >= free.radius - 1e-3
    assert shapely.distance(scene.room.exterior, lines).min() >= free.radius - 1e-3
    assert (roadmap.component[roadmap.edges[:, 0]] == roadmap.component[roadmap.edges[:, 1]]).all()
    assert (free.indices(roadmap.points) == roadmap.regions[roadmap.component]).all()
    assert len(set(roadmap.regions.tolist())) == len(roadmap.regions)
    large = {number for number, region in enumerate(free.regions) if region.area >= settings.least_area}
    assert large <= set(roadmap.regions.tolist())


def test_one_seed_gives_one_roadmap_byte_for_byte_and_another_one_another() -> None:
    scene = office(12, 1)
    one, two, other = (build_roadmap(scene, np.random.default_rng(seed)) for seed in (3, 3, 4))
    for part in ("points", "component", "edges", "regions"):
        assert getattr(one, part).tobytes() == getattr(two, part).tobytes()
    assert [g.point.tobytes() for name in one.grasps for g in one.grasps[name]] == [
        g.point.tobytes() for name in two.grasps for g in two.grasps[name]
    ]
    assert one.points.tobytes() != other.points.tobytes()


@pytest.mark.parametrize("seed", range(3))
def test_a_grasp_sample_is_a_grasp_that_pbrl_control_finds_as_well(seed: int) -> None:
    scene = office(8, seed)
    roadmap, rng = build_roadmap(scene, np.random.default_rng(seed)), np.random.default_rng(seed)
    samples = [grasp for grasps in roadmap.grasps.values() for grasp in grasps]
    assert {grasp.hands for grasp in samples} == {("left", "right"), ("left",), ("right",)}
    for index in rng.choice(len(samples), 12, replace=False):
        grasp = samples[index]
        thing = scene.movable[grasp.object]
        left = rotation(grasp.normal - math.pi / 2.0) @ np.array([1.0, 0.0])  # as the robot sees it
        offsets = {"left": 0.1 + 1e-9, "right": -0.1 - 1e-9} if len(grasp.hands) > 1 else {grasp.hands[0]: 0.0}
        points = {side: grasp.contact + offset * left for side, offset in offsets.items()}
        stand = np.array([*grasp.point, grasp.heading])
        shape = BodyShape(thing.footprint, thing.height)
        found = grasps_at(grasp.object, shape, scene.poses[grasp.object], points, stand, scene.floor(), rng)
        assert len(found.candidates) == 1, found.why()
        base = found.candidates[0].base_goal
        assert base[:2] == pytest.approx(stand[:2], abs=1e-6) and wrap(base[2] - stand[2]) == pytest.approx(0, abs=1e-6)
        facing = scene.poses[grasp.object][2] + grasp.normal + math.pi
        assert wrap(facing - grasp.heading) == pytest.approx(0.0, abs=1e-9)
        outline = shapely.Polygon(thing.footprint)
        assert outline.exterior.distance(shapely.Point(grasp.contact)) < 1e-9


def test_a_few_places_to_grasp_from_are_found_whatever_the_draw() -> None:
    """Sampling at the coarse spacing alone misses this office's only stands in three draws of five."""
    scene = office(5, 34)
    found = [build_roadmap(scene, np.random.default_rng(seed)) for seed in range(5)]
    regions = {tuple(roadmap.grasp_regions(name) for name in scene.movable) for roadmap in found}
    assert len(regions) == 1


def test_grasps_know_the_component_that_their_stand_is_in() -> None:
    scene = corridor(6.0)
    free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
    for grasp in roadmap.grasps["table_1"]:
        assert roadmap.regions[grasp.component] == free.index(grasp.point)
    assert roadmap.grasp_regions("table_1") == {0, 1}


def test_a_passage_that_no_sample_falls_into_is_found_all_the_same() -> None:
    """Two rooms with a winding passage between them, 3 mm wider than the disc: a needle's eye for a sampler."""
    gap = 1.043
    scene = NamoScene.of(
        box(0.0, 0.0, 10.0, 6.0),
        {
            "one": box(3.0, 0.0, 4.0, 6.0 - gap),
            "two": box(4.0 + gap, gap, 5.0 + gap, 6.0),
        },
        {},
        {},
        np.array([1.0, 1.0, 0.0]),
        np.array([9.0, 1.0, 0.0]),
    )
    free = free_space(scene)
    roadmap = build_roadmap(scene, np.random.default_rng(0), RegionSettings(density=0.3))
    assert len(free.regions) == 1 and roadmap.regions.tolist() == [0]


def test_regions_that_the_uniform_draw_misses_get_milestones_of_their_own() -> None:
    free = free_space(office(20, 2))
    roadmap = build_roadmap(office(20, 2), np.random.default_rng(0), RegionSettings(density=1e-3))
    large = {number for number, region in enumerate(free.regions) if region.area >= RegionSettings().least_area}
    assert large <= set(roadmap.regions.tolist())


@pytest.mark.parametrize(
    ("thing", "why"),
    [
        (table(height=0.3), "edge: expected 0.6 to 0.92 m above the floor, is at 0.287 m"),
        (table(height=1.4), "edge: expected 0.6 to 0.92 m"),
        (table(0.2, 0.2), "faces: expected one over 0.254 m long, the longest is 0.200 m"),
        (
            Movable(np.column_stack((np.cos(np.arange(40) * math.pi / 20), np.sin(np.arange(40) * math.pi / 20)))),
            "faces",
        ),
    ],
)
def test_what_grippers_cannot_hold_has_no_grasps_and_says_why(thing: Movable, why: str) -> None:
    assert why in grasp_refusal(thing, RegionSettings().grasp)
    scene = replace(corridor(6.0), movable={"table_1": thing})
    assert build_roadmap(scene, np.random.default_rng(0)).grasps == {"table_1": ()}


def test_corners_on_a_straight_face_do_not_make_two_faces_of_it() -> None:
    plain = table(0.3, 0.3)
    split = Movable(np.insert(plain.footprint, [1, 2], [[0.0, -0.15], [0.15, 0.0]], axis=0), plain.height, plain.mass)
    assert grasp_refusal(plain, RegionSettings().grasp) == grasp_refusal(split, RegionSettings().grasp) == ""
    grasps = build_roadmap(replace(corridor(6.0), movable={"table_1": split}), np.random.default_rng(0)).grasps
    assert len(grasps["table_1"]) > 0


def test_a_table_in_a_corner_is_gripped_from_the_open_sides_only() -> None:
    scene = corridor(6.0).moved({"table_1": np.array([0.4, 0.78, 0.0])})
    grasps = build_roadmap(replace(scene, room=shapely.box(0, 0, 12, 6)), np.random.default_rng(0)).grasps["table_1"]
    assert {round(grasp.normal, 3) for grasp in grasps} == {0.0, round(math.pi / 2, 3)}


def test_a_room_without_anything_and_one_without_room_have_roadmaps() -> None:
    assert build_roadmap(corridor(), np.random.default_rng(0)).grasps == {}
    small = NamoScene.of(box(0, 0, 1, 1), {}, {}, {}, *np.full((2, 3), 0.5))
    roadmap = build_roadmap(small, np.random.default_rng(0))
    assert len(roadmap.points) == len(roadmap.edges) == len(roadmap.regions) == 0


def test_a_thing_of_another_scene_is_refused() -> None:
    with pytest.raises(NamoError, match="expected one made with 'sofa'"):
        build_roadmap(corridor(6.0), np.random.default_rng(0)).grasp_regions("sofa")


@pytest.mark.parametrize("told", [{"density": 0.0}, {"radius": -1.0}, {"neighbours": 0}, {"reach": 2.0}])
def test_settings_that_cannot_be_are_refused(told: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(told))):
        RegionSettings.model_validate(told)


def test_ways_through_a_polygon_stay_in_it_and_are_short() -> None:
    ring = (
        shapely.Point(0, 0)
        .buffer(2.0)
        .difference(shapely.Point(0, 0).buffer(1.9))
        .difference(shapely.box(-0.1, 0, 0.1, 3))
    )
    ends = np.array([[1.95, 0.0], [0.0, -1.95], [-0.3, 1.93]])
    start = np.array([0.3, 1.93])
    for end, way in zip(ends, ways_through(ring, start, ends), strict=True):
        assert way[0] == pytest.approx(start) and way[-1] == pytest.approx(end)
        assert ring.buffer(1e-9).covers(shapely.linestrings(way))
    assert shapely.length(shapely.linestrings(way)) < 1.95 * (2 * math.pi - 0.3)
    with pytest.raises(NamoError, match="expected points of the polygon"):
        ways_through(ring, start, np.array([[0.0, 0.0]]))


def test_eighty_things_take_about_a_second_at_most() -> None:
    scene, spent = office(80, 2), []
    for _ in range(3):
        begin = time.process_time()
        free, roadmap = free_space(scene), build_roadmap(scene, np.random.default_rng(0))
        assert len(openings(scene, free, roadmap)) > 50
        spent.append(time.process_time() - begin)
    assert min(spent) < 1.5  # 0.4 s on an idle core
