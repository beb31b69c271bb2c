from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from shapely.geometry import Polygon

from bullet_sim.client import GRAVITY
from bullet_sim.errors import SimError
from bullet_sim.prisms import convex_parts

L_SHAPE = [[0, 0], [0.8, 0], [0.8, 0.3], [0.3, 0.3], [0.3, 0.8], [0, 0.8]]


def total_mass(world: Any, name: str) -> float:
    api, body = world.client.api, world.client.body(name)
    return sum(api.getDynamicsInfo(body, link)[0] for link in range(-1, api.getNumJoints(body)))


def test_table_has_the_mass_told_or_the_one_concealed(lab: Any) -> None:
    assert total_mass(lab.world(), "table_a") == pytest.approx(33.0)
    heavy = lab.world(lab.scene(concealed={"mass": {"table_a": 50.0}}))
    assert total_mass(heavy, "table_a") == pytest.approx(50.0)


def test_table_centre_of_mass_is_about_55_centimetres_high(lab: Any) -> None:
    world = lab.world()
    api, body = world.client.api, world.client.body("table_a")
    weights = [api.getDynamicsInfo(body, link)[0] for link in range(-1, api.getNumJoints(body))]
    heights = [api.getBasePositionAndOrientation(body)[0][2]]
    heights += [api.getLinkState(body, link)[0][2] for link in range(api.getNumJoints(body))]
    assert float(np.average(heights, weights=weights)) == pytest.approx(0.57, abs=0.02)


def test_yaw_inertia_is_that_of_slab_legs_and_casters(lab: Any) -> None:
    easy = {"swivel_friction": 0.0, "contact_width": 0.0, "rolling_resistance": 0.0}
    world = lab.world(lab.scene({"table_a": {**lab.table, "casters": {**easy, "trail": 0.0}}}))
    lab.run(world, 0.1)
    world.client.api.setGravity(0, 0, 0)
    body = world.find("table_a")
    lab.run(world, 0.1)
    spin = body.twist().angular[2]
    lever = np.array([0.0, 0.5, 0.0])

    def couple() -> None:
        pose = body.pose()
        force = pose.matrix @ [-10.0, 0.0, 0.0]
        body.apply_force(force, pose.point(lever))
        body.apply_force(-force, pose.point(-lever))

    lab.run(world, 0.1, couple)
    slab = 680 * 0.75 * 1.5 * 0.025
    frame = 33 - 4 * 0.45 - slab
    corner = 0.315**2 + 0.69**2
    expected = slab / 12 * (0.75**2 + 1.5**2) + (0.3 * frame + 4 * 0.45) * corner
    expected += 0.05 * frame * (0.69**2 + 0.63**2 / 12) + 0.65 * frame * 1.38**2 / 12
    assert 10.0 * 0.1 / (body.twist().angular[2] - spin) == pytest.approx(expected, rel=0.02)
    assert 1.1 * 7.7 < expected < 1.25 * 7.7, "a tenth to a quarter above a uniform slab of the whole mass"


def test_tag_frame_is_at_the_top_in_the_middle_and_moves_as_its_twist_says(lab: Any) -> None:
    world = lab.world(lab.scene({"table_a": {**lab.table, "pose": [1.0, 2.0, 0.5]}}))
    np.testing.assert_allclose(world.truth("table_a").planar, [1.0, 2.0, 0.5], atol=1e-6)
    assert world.pose("table_a").position[2] == pytest.approx(0.7775, abs=1e-5)
    body = world.find("table_a")
    lab.run(world, 0.4, lambda: body.apply_force(np.array([30.0, 10.0, 0.0]), body.pose().point([0, 0.6, -0.1])))
    first = world.truth("table_a")
    world.step()
    second = world.truth("table_a")
    np.testing.assert_allclose(
        (second.position - first.position)[:2] / world.client.step_time, second.linear[:2], atol=2e-3
    )
    turned = (second.planar[2] - first.planar[2]) / world.client.step_time
    assert turned == pytest.approx(second.angular[2], abs=2e-3)


def test_halving_the_step_changes_a_pushed_tables_path_by_less_than_a_tags_noise(lab: Any) -> None:
    ends = []
    for step in (1 / 400, 1 / 800):
        world = lab.world(seed=1, step=step)
        body = world.find("table_a")
        lab.run(world, 0.25)
        lab.run(
            world, 3.0, lambda body=body: body.apply_force(np.array([15.0, 0, 0]), body.pose().point([-0.3, 0.3, 0]))
        )
        ends.append(world.truth("table_a").planar)
    assert np.hypot(*ends[0][:2]) > 0.3
    apart = np.abs(ends[0] - ends[1])
    assert np.hypot(*apart[:2]) < 0.003
    assert apart[2] < np.deg2rad(0.5)


def test_same_seed_same_bytes_and_another_seed_another_run(lab: Any) -> None:
    def run(seed: int) -> bytes:
        world = lab.world(lab.scene({"table_a": lab.table, "table_b": {**lab.table, "pose": [0.9, 0.4, 0]}}), seed=seed)
        body = world.find("table_a")
        lab.run(world, 1.5, lambda: body.apply_force(np.array([40.0, 0, 0]), body.pose().point([0, 0.2, -0.01])))
        truth = world.truth("table_b")
        return truth.position.tobytes() + truth.quaternion.tobytes() + truth.linear.tobytes()

    assert run(1) == run(1)
    assert run(1) != run(2)


def test_tables_push_each_other_and_walls_stop_them(lab: Any) -> None:
    small = {"outline": [[-2, -2], [1.5, -2], [1.5, 2], [-2, 2]]}
    bodies = {"table_a": lab.table, "table_b": {**lab.table, "pose": [0.8, 0.0, 0.0]}}
    world = lab.world(lab.scene(bodies, room=small, robot={"pose": [-1.5, 0, 0]}))
    body = world.find("table_a")
    lab.run(world, 4.0, lambda: body.apply_force(np.array([40.0, 0, 0]), body.pose().point([0, 0, -0.01])))
    ahead = world.truth("table_b").planar
    assert ahead[0] == pytest.approx(1.5 - 0.375, abs=0.03), "table_b stands at the wall"
    assert world.truth("table_a").planar[0] == pytest.approx(1.5 - 3 * 0.375, abs=0.05)


def test_a_block_slides_beyond_its_friction_and_not_below(lab: Any) -> None:
    block = {
        "kind": "block",
        "polygon": L_SHAPE,
        "height": 0.4,
        "nominal_mass": 10.0,
        "friction": 0.4,
        "pose": [0, 0, 0],
    }
    limit = 0.4 * 10 * GRAVITY
    centroid = np.array(Polygon(L_SHAPE).centroid.coords[0])
    for share, accelerates in ((0.9, 0.0), (1.5, 0.5 * 0.4 * GRAVITY)):
        world = lab.world(lab.scene({"box": block}))
        body = world.find("box")
        lab.run(world, 0.2)
        force = np.array([share * limit, 0, 0])
        lab.run(world, 0.5, lambda b=body, f=force: b.apply_force(f, b.pose().point([*centroid, -0.39])))
        assert body.twist().linear[0] / 0.5 == pytest.approx(accelerates, abs=0.03 * 0.4 * GRAVITY)
        assert abs(body.pose().yaw) < 0.02, "pushed through its centre of mass it does not turn"


def test_a_fixture_stays(lab: Any) -> None:
    world = lab.world(
        lab.scene({"counter": {"kind": "fixture", "polygon": L_SHAPE, "height": 0.9, "pose": [1, 1, 0.3]}})
    )
    body = world.find("counter")
    lab.run(world, 0.2, lambda: body.apply_force(np.array([1e4, 0, 0]), body.pose().position))
    np.testing.assert_allclose(world.truth("counter").planar, [1, 1, 0.3], atol=1e-9)


def test_a_fixture_on_the_wall_leaves_room_underneath(lab: Any) -> None:
    slab = {"kind": "fixture", "polygon": L_SHAPE, "height": 0.74, "underside": 0.70, "pose": [1, 1, 0.3]}
    world = lab.world(lab.scene({"slab": slab}))
    middle = world.find("slab").pose().position[:2]
    down = world.client.api.rayTest([*middle, 2.0], [*middle, 0.1])[0]
    up = world.client.api.rayTest([*middle, 0.1], [*middle, 2.0])[0]
    assert [hit[3][2] for hit in (down, up)] == pytest.approx([0.74, 0.70], abs=2e-3)  # Bullet's own margin
    assert world.find("slab").settings.levels == (0.70, 0.74)
    with pytest.raises(SimError, match="underside below the height"):
        lab.scene({"slab": slab | {"underside": 0.8}})


def test_convex_parts_cover_the_outline_and_nothing_else() -> None:
    parts = [Polygon(part) for part in convex_parts(np.array(L_SHAPE, dtype=float))]
    assert all(math.isclose(part.convex_hull.area, part.area) for part in parts)
    whole = Polygon(L_SHAPE)
    assert sum(part.area for part in parts) == pytest.approx(whole.area)
    assert all(whole.buffer(1e-9).contains(part) for part in parts)
    assert len(convex_parts(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float))) == 1


def test_unknown_body_and_impossible_mass_are_one_line_errors(lab: Any) -> None:
    with pytest.raises(SimError, match="'table_1' is not in the scene; did you mean 'table_a'"):
        lab.world().truth("table_1")
    with pytest.raises(SimError, match="'table_a': expected a mass over twice its casters', got 2"):
        lab.world(lab.scene(concealed={"mass": {"table_a": 2.0}}))
