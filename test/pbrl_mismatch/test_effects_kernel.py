"""The kernel with effects: off it is the world model's; each effect against a closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from kernel_bench import DT, moving, pushed, speeds
from pushed_table import MASS
from scipy.integrate import solve_ivp

from pbrl_mismatch.data.simulation import poses
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.kernels.columns import COLUMN, neutral_row
from pbrl_model.rollout import rollout

GRAVITY = 9.81
INERTIA = MASS * (1.2**2 + 0.7**2) / 12


@pytest.mark.parametrize("hinge", [np.nan, 0.0, 0.8])
def test_with_every_effect_off_it_is_the_world_models_kernel(bench: Any, hinge: float) -> None:
    rng = np.random.default_rng(3)
    wrench = rng.normal(size=(150, 3)) * [30.0, 30.0, 8.0]
    start = np.array([0.5, -0.2, 0.7, 0.1, -0.1, 0.3])
    row = neutral_row()
    row[:12] = [MASS, -0.4, 0.2, 0.6, 0.1, 0.2, 0.1, -0.1, hinge, 0.3, 0.1, 0.02]
    if hinge == 0.0:
        c, s = np.cos(0.7), np.sin(0.7)
        row[6:8] = start[:2] + np.array([c * 0.3 - s * 0.1, s * 0.3 + c * 0.1])
    world = bench(wrench, start)
    ours = poses(row[None], world.cuts())[0, 0]
    theirs = rollout(row[None, :12], start[None], wrench[None], INERTIA / MASS)[0, 0]
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_parallel_gives_the_same_bytes(bench: Any) -> None:
    rows = np.tile(neutral_row(), (7, 1))
    rows[:, COLUMN["drag_linear"]] = np.arange(7)
    cuts = bench(pushed(5.0)).cuts()
    assert np.array_equal(poses(rows, cuts), poses(rows, cuts, parallel=True))


def test_viscous_drag_decays_by_its_own_law(bench: Any) -> None:
    path = bench(pushed(0.0), moving(1.0, 1.0)).run(drag_linear=10.0, drag_turn=3.0)
    n = np.arange(1, 200)
    np.testing.assert_allclose(speeds(path)[1:, 0], (1 + 10.0 * DT / MASS) ** -n, rtol=1e-9)
    np.testing.assert_allclose(speeds(path)[1:, 2], (1 + 3.0 * DT / INERTIA) ** -n, rtol=1e-9)


def test_ground_friction_stops_a_slide_where_coulomb_says(bench: Any) -> None:
    path = bench(pushed(0.0), moving(0.5)).run(slide_mu=0.05)
    assert path[-1, 0] == pytest.approx(0.5**2 / (2 * 0.05 * GRAVITY), abs=4e-3)


def test_ground_friction_spins_down_by_the_feet_s_levers(bench: Any) -> None:
    path = bench(pushed(0.0, 40), moving(0.0, 1.0)).run(slide_mu=0.05)
    lever = np.hypot(0.5, 0.28)
    wanted = 1.0 - 0.05 * MASS * GRAVITY * lever / INERTIA * 0.39
    assert speeds(path)[-1, 2] == pytest.approx(wanted, abs=2e-3)


def test_a_load_off_the_middle_turns_a_slide_by_its_lever_and_brakes_it_no_more(bench: Any) -> None:
    even = bench(pushed(0.0, 20), moving(0.5)).run(slide_mu=0.05)
    off = bench(pushed(0.0, 20), moving(0.5)).run(slide_mu=0.05, load_y=0.1)
    np.testing.assert_allclose(speeds(off)[:, 0], speeds(even)[:, 0], rtol=1e-3)
    turned = 0.05 * MASS * GRAVITY * 0.1 / INERTIA
    assert np.diff(speeds(off)[:3, 2]).max() / DT == pytest.approx(turned, rel=0.02)


def test_a_force_over_the_floor_loads_the_feet_that_it_tips_the_body_onto(bench: Any) -> None:
    across = np.tile([0.0, 30.0, 0.0], (20, 1))
    path = bench(across, moving(0.5)).run(slide_mu=0.02, load_height=0.5)
    plain = bench(across, moving(0.5)).run(slide_mu=0.02)
    turned = 0.02 * 30.0 * 0.5 / INERTIA
    gained = np.diff(speeds(path)[:, 2] - speeds(plain)[:, 2])[:5].mean() / DT
    assert gained == pytest.approx(turned, rel=0.1)


def test_breakaway_friction_holds_until_its_static_limit(bench: Any) -> None:
    law = {"slide_mu": 0.02, "breakaway_mu": 0.05, "breakaway_speed": 0.02}
    held = bench(pushed(0.06 * MASS * GRAVITY)).run(**law)
    slid = bench(pushed(0.08 * MASS * GRAVITY)).run(**law)
    assert held[-1, 0] < 0.01
    assert speeds(slid)[-1, 0] > 0.5


def test_second_wheel_is_the_first_wheel_elsewhere(bench: Any) -> None:
    world = bench(np.tile([30.0, 5.0, 2.0], (150, 1)), moving(0.3, 0.2))
    one = world.run(cone=1.0, wheel_x=-0.4, wheel_y=0.2, wheel_theta=0.5, mu_x=0.05, mu_y=0.1)
    other = world.run(wheel2_x=-0.4, wheel2_y=0.2, wheel2_theta=0.5, wheel2_mu_x=0.05, wheel2_mu_y=0.1)
    np.testing.assert_allclose(other, one, atol=2e-3)


def test_where_on_its_axle_a_wheel_is_that_rolls_freely_no_motion_shows(bench: Any) -> None:
    world, turn = bench(np.tile([12.0, 7.0, 5.0], (200, 1)), moving(0.2, 0.4)), 0.5

    def along_axle(way: float, rolling: float) -> np.ndarray:
        place = {"wheel2_x": -0.4 - way * np.sin(turn), "wheel2_y": 0.2 + way * np.cos(turn)}
        return world.run(wheel2_theta=turn, wheel2_mu_x=rolling, wheel2_mu_y=0.1, **place)

    np.testing.assert_allclose(along_axle(0.5, 0.0), along_axle(0.0, 0.0), atol=1e-9)
    assert np.abs(along_axle(0.5, 0.05) - along_axle(0.0, 0.05)).max() > 1e-3


def test_wheel_slides_as_the_world_model_s_along_its_axis(bench: Any) -> None:
    world = bench(pushed(30.0, 150), moving(0.3))
    box = world.run(wheel_x=-0.4, mu_x=0.05, mu_y=0.1)
    cone = world.run(cone=1.0, wheel_x=-0.4, mu_x=0.05, mu_y=0.1)
    np.testing.assert_allclose(cone, box, atol=1e-4)


def test_locked_caster_drags_against_the_motion_whatever_its_direction(bench: Any) -> None:
    start = np.array([0.0, 0.0, 0.0, 0.3, 0.4, 0.0])
    path = bench(pushed(0.0, 30), start).run(cone=1.0, mu_x=0.05, mu_y=-1.0)
    slowing = np.diff(speeds(path)[:, :2], axis=0)[-1] / DT
    np.testing.assert_allclose(slowing, -0.05 * GRAVITY * np.array([0.6, 0.8]), rtol=1e-3)


def test_patch_brakes_only_inside(bench: Any) -> None:
    path = bench(pushed(0.0, 150), moving(0.8)).run(patch_mu=0.1, patch_x=1.5, patch_length=0.5, patch_width=2.0)
    front = 0.5 + path[:-1, 0]
    outside = front < 0.97
    np.testing.assert_allclose(speeds(path)[outside, 0], 0.8, atol=2e-3)
    both = (front > 1.05) & (front < 1.9)
    slowing = np.diff(speeds(path)[both, 0]) / DT
    assert np.median(slowing) == pytest.approx(-0.1 * GRAVITY / 2, rel=0.02)  # two feet of four


def test_a_wheel_on_a_patch_is_held_back_along_its_way_and_across_as_before(bench: Any) -> None:
    patch = {"patch_roll": 0.03, "patch_x": 1.5, "patch_length": 0.5, "patch_width": 2.0}
    wheel = {"cone": 1.0, "wheel_x": 0.2, "mu_x": 1e-4, "mu_y": 0.2}
    path = bench(pushed(0.0, 150), moving(0.8)).run(**wheel, **patch)
    before, on = path[:-1, 0] + 0.2 < 0.97, (path[:-1, 0] + 0.2 > 1.05) & (path[:-1, 0] + 0.2 < 1.9)
    slowing = np.diff(speeds(path)[:, 0]) / DT
    n = len(slowing)
    assert np.median(slowing[before[:n]]) == pytest.approx(-1e-4 * GRAVITY, abs=2e-3)
    assert np.median(slowing[on[:n]]) == pytest.approx(-0.03 * GRAVITY, rel=0.02)
    aside = bench(pushed(0.0, 30), np.array([1.5, 0.0, 0.0, 0.0, 0.3, 0.0]))
    np.testing.assert_allclose(aside.run(**wheel, **patch), aside.run(**wheel), atol=2e-3)


def test_slope_pulls_by_the_weight(bench: Any) -> None:
    path = bench(pushed(0.0)).run(slope_x=0.01, slope_y=-0.02)
    t = 2.0
    np.testing.assert_allclose(path[-1, :2], 0.5 * GRAVITY * t**2 * np.array([0.01, -0.02]), rtol=0.01)


def test_com_offset_gives_a_central_push_a_moment(bench: Any) -> None:
    path = bench(pushed(4.0, 50)).run(com_y=0.1)
    assert np.diff(speeds(path)[:, 2])[5] / DT == pytest.approx(4.0 * 0.1 / INERTIA, rel=0.01)


def test_payload_changes_the_mass_at_its_time(bench: Any) -> None:
    change = np.diff(speeds(bench(pushed(10.0)).run(payload_mass=5.0, payload_time=1.0))[:, 0]) / DT
    assert change[20] == pytest.approx(10.0 / 20.0)
    assert change[150] == pytest.approx(10.0 / 25.0)
    gone = bench(pushed(10.0)).run(payload_mass=5.0, payload_time=1.0, payload_gone=1.0)
    change = np.diff(speeds(gone)[:, 0]) / DT
    assert change[20] == pytest.approx(10.0 / 25.0)
    assert change[150] == pytest.approx(10.0 / 20.0)


def test_what_is_put_on_shares_the_momentum_and_what_is_taken_off_keeps_its_speed(bench: Any) -> None:
    law = {"payload_mass": 5.0, "payload_time": 1.0}
    put_on = speeds(bench(pushed(0.0), moving(0.5)).run(**law))[:, 0]
    assert put_on[20] == pytest.approx(0.5) and put_on[-1] == pytest.approx(0.5 * 20.0 / 25.0)
    taken_off = speeds(bench(pushed(0.0), moving(0.5)).run(**law, payload_gone=1.0))[:, 0]
    np.testing.assert_allclose(taken_off, 0.5)
    aside = bench(pushed(0.0), moving(0.0, 0.4)).run(**law, payload_x=0.3)
    inertia = INERTIA + 5.0 * 20.0 / 25.0 * 0.3**2
    assert speeds(aside)[-1, 2] == pytest.approx(0.4 * INERTIA / inertia)


@pytest.mark.parametrize(
    "wheel",
    [
        {},
        {"mu_x": 0.05},
        {"mu_x": 0.05, "cone": 1.0, "mu_y": -1.0},
        {"wheel2_mu_x": 0.05},
        {"slide_mu": 0.05},
        {"mu_ground": 0.05},
        {"slope_x": -0.05},
    ],
)
def test_swinging_load_moves_as_two_masses_on_a_spring(bench: Any, wheel: dict[str, float]) -> None:
    rate, zeta, load = 2 * np.pi * 0.7, 0.1, 3.0
    # What rubs takes its part of the push, by the weight of all; the load swings in what is left, by either solver.
    push = 20.0 - (0.05 * MASS * GRAVITY if wheel else 0.0)

    def two(_: float, y: np.ndarray) -> list[float]:
        spring = load * (rate**2 * y[2] + 2 * zeta * rate * y[3])
        a = (push + spring) / (MASS - load)  # the load is part of what the body weighs
        return [y[1], a, y[3], -a - rate**2 * y[2] - 2 * zeta * rate * y[3]]

    wanted = solve_ivp(two, (0, 2.0), [0, 0, 0, 0], rtol=1e-9, t_eval=[1.0, 2.0]).y[0]
    path = bench(pushed(20.0)).run(slosh_mass=load, slosh_frequency=0.7, slosh_damping=zeta, **wheel)
    np.testing.assert_allclose(path[[100, 200], 0], wanted, rtol=0.03)


def test_a_load_on_a_stiff_spring_is_a_weight_where_it_hangs(bench: Any) -> None:
    load, place = 5.0, 0.3
    path = bench(pushed(8.0, 60)).run(slosh_mass=load, slosh_y=place, slosh_frequency=6.0, slosh_damping=0.7)
    # One rigid body: the push is off the common centre of mass.
    arm = load * place / MASS
    inertia = INERTIA * (1.0 - load / MASS) + load * (1.0 - load / MASS) * place**2
    assert speeds(path)[-1, 2] == pytest.approx(8.0 * arm / inertia * 0.6, rel=0.05)


def test_tether_is_slack_within_its_length_and_pulls_beyond(bench: Any) -> None:
    law = {"tether_stiffness": 50.0, "tether_x": -1.0}
    slack = bench(pushed(1.0, 50)).run(**law, tether_length=2.0)
    np.testing.assert_array_equal(slack, bench(pushed(1.0, 50)).run())
    taut = bench(pushed(0.0, 50)).run(**law, tether_length=0.8)
    assert np.diff(speeds(taut)[:, 0])[1] / DT == pytest.approx(-50.0 * 0.2 / MASS, rel=0.1)


def test_external_force_adds_up(bench: Any) -> None:
    path = bench(pushed(0.0)).run(steady_y=2.0, periodic_x=6.0, periodic_frequency=0.5)
    assert path[-1, 1] == pytest.approx(0.5 * 2.0 / MASS * 4.0, rel=0.01)
    # The mean of the speed under a sine that begins at zero is a quarter wave's share.
    assert path[-1, 0] == pytest.approx(6.0 / MASS / (np.pi) * 2.0, rel=0.02)


def test_a_push_between_two_moments_gives_its_impulse(bench: Any) -> None:
    path = bench(pushed(0.0, 300)).run(steady_x=6.0, force_start=0.8, force_end=2.0)
    speed = speeds(path)[:, 0]
    np.testing.assert_allclose(speed[:70], 0.0, atol=1e-12)
    assert speed[-1] == pytest.approx(6.0 * 1.2 / MASS, rel=1e-3)
    assert np.ptp(speed[210:]) < 1e-12


def test_obstacle_holds_with_its_stiffness(bench: Any) -> None:
    path = bench(pushed(20.0, 600)).run(obstacle_stiffness=10000.0, obstacle_x=0.8, obstacle_radius=0.1)
    assert path[-1, 0] == pytest.approx(0.1 + 20.0 / 10000.0, abs=2e-4)


@pytest.mark.parametrize("friction", [0.1, 0.5])
def test_unseen_body_resists_by_its_friction_and_goes_along_once_met(bench: Any, friction: float) -> None:
    told = {"unseen_force": 8.0, "unseen_x": 0.8, "unseen_radius": 0.1, "unseen_friction": friction}
    path = bench(pushed(20.0, 200)).run(**told)
    change = np.diff(speeds(path)[:, 0]) / DT
    assert change[5] == pytest.approx(1.0, rel=1e-6)
    both = MASS + 8.0 / (friction * GRAVITY)
    assert np.mean(change[150:190]) == pytest.approx((20.0 - 8.0) / both, rel=0.03)


def test_hidden_hinge_holds_its_point(bench: Any) -> None:
    path = bench(np.tile([0.0, 6.0, 0.0], (200, 1))).run(pivot_stiffness=20000.0, pivot_x=-0.5)
    held = path[:, :2] - 0.5 * np.stack([np.cos(path[:, 2]), np.sin(path[:, 2])], -1)
    assert np.abs(held - [-0.5, 0.0]).max() < 0.005
    assert path[-1, 2] > 0.5


def test_hidden_hinge_that_was_not_at_rest_pulls_by_what_it_was_off(bench: Any) -> None:
    heading, off = 0.7, np.array([0.003, -0.001])
    start = np.array([0.0, 0.0, heading, 0.0, 0.0, 0.0])
    path = bench(pushed(0.0, 3), start).run(pivot_stiffness=1000.0, pivot_off_x=off[0], pivot_off_y=off[1])
    turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    np.testing.assert_allclose(speeds(path)[1, :2] * MASS / DT, -1000.0 * turn @ off, rtol=0.1)
    at_rest = bench(pushed(0.0, 3), start).run(pivot_stiffness=1000.0)
    np.testing.assert_allclose(at_rest, np.tile(start[:3], (len(at_rest), 1)), atol=1e-12)


def test_a_pinned_body_whose_tag_is_off_is_at_rest_where_it_was_seen(bench: Any) -> None:
    off = {"tag_x": 0.06, "tag_y": -0.03, "tag_theta": 0.1}
    path = bench(np.zeros((200, 3))).run(pivot_stiffness=4000.0, pivot_x=0.5, **off)
    np.testing.assert_allclose(path, np.broadcast_to(path[:1], path.shape), atol=1e-9)


@pytest.mark.parametrize("zeta", [0.1, 0.5])
def test_hidden_hinge_swings_as_its_give_and_damping_say(bench: Any, zeta: float) -> None:
    dt, stiffness = 5e-4, 2000.0
    rate = np.sqrt(stiffness / MASS)
    wanted = solve_ivp(
        lambda _, y: [y[1], -(rate**2) * y[0] - 2 * zeta * rate * y[1]], (0, 0.6), [0.0, 0.2], rtol=1e-9, t_eval=[0.6]
    ).y[0]
    times = bench(pushed(0.0, 1200), moving(0.2), dt)
    path = times.run(pivot_stiffness=stiffness, pivot_damping=zeta)
    assert path[-1, 0] == pytest.approx(wanted[0], abs=0.01 * 0.2 / rate)


def test_a_catch_that_holds_a_point_turns_the_body(bench: Any) -> None:
    law = {"detent_force": 10.0, "detent_width": 0.05, "detent_at_y": 0.3}
    path = bench(pushed(0.0, 3)).run(**law, detent_x=0.05, detent_y=0.3)
    push = speeds(path)[1] / DT
    assert push[0] * MASS == pytest.approx(10.0, rel=0.02)
    assert push[2] * INERTIA == pytest.approx(-0.3 * push[0] * MASS, rel=0.02)


def test_detent_pulls_hardest_at_its_width(bench: Any) -> None:
    def pull(place: float) -> float:
        start = np.array([place, 0.0, 0.0, 0.0, 0.0, 0.0])
        path = bench(pushed(0.0, 3), start).run(detent_force=10.0, detent_width=0.05)
        return float(speeds(path)[1, 0]) * MASS / DT

    assert pull(0.0) == 0.0
    assert pull(0.0501) == pytest.approx(-10.0, rel=0.02)
    assert abs(pull(0.03)) < 10.0 > abs(pull(0.08))


def test_casters_that_follow_resist_along_the_way(bench: Any) -> None:
    path = bench(pushed(0.0, 100), moving(0.5)).run(caster_roll=0.02, caster_trail=0.03)
    assert np.diff(speeds(path)[:, 0])[-1] / DT == pytest.approx(-0.02 * GRAVITY, rel=0.01)
    across = bench(pushed(0.0, 8), moving(0.5)).run(caster_roll=0.02, caster_trail=0.03, caster_heading=1.2)
    assert abs(across[-1, 1]) > 1e-5  # until they have turned they push aside


def test_rows_of_another_width_are_refused(bench: Any) -> None:
    with pytest.raises(MismatchError, match="columns"):
        poses(np.zeros((2, 12)), bench(pushed(1.0)).cuts())
