"""Commands by model class (figure 40), and which worlds obey them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from manipulation_rooms import WHEEL, box, pinned, rolling, stuck

from pbrl_control.constraints.classes import ModelClass
from pbrl_control.constraints.twist import achievable_twist
from pbrl_control.types import PlanarTwist
from pbrl_namo.beliefs import ObjectBelief, belief_of_draws, prior_belief
from pbrl_namo.manipulation import ManipulationSettings
from pbrl_namo.manipulation.policies import Commands, alike, centre_of, drives_of
from pbrl_namo.manipulation.worlds import Worlds
from pbrl_namo.scene import Movable

SETTINGS = ManipulationSettings()
TABLE = Movable(box(0.75, 1.5, (0.1, -0.05)), 0.75, 33.0)  # its centre of mass is not its frame's origin


def studied(belief: ObjectBelief, seed: int = 0) -> tuple[Worlds, Commands]:
    worlds = Worlds.sample(belief, np.zeros(3), np.random.default_rng(seed), 30, SETTINGS.constraints)
    return worlds, Commands.of(worlds, SETTINGS)


def test_a_free_thing_goes_along_its_axes_and_turns_about_its_middle() -> None:
    worlds, commands = studied(rolling(TABLE))
    assert set(worlds.classes()) == {ModelClass.UNCONSTRAINED}
    straight = {tuple(twist.round(9)) for twist in commands.twists if twist[2] == 0.0}
    assert straight == {(1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)}
    turns = [twist for twist in commands.twists if twist[2] != 0.0]
    assert sorted(twist[2] for twist in turns) == [-1.0, 1.0]
    assert all(centre_of(twist) == pytest.approx([0.1, -0.05]) for twist in turns)
    assert commands.obeys.all()


def test_a_wheeled_thing_rolls_along_its_axis_and_turns_about_its_wheel() -> None:
    rows = np.array([[33.0, 0.2, -0.4, math.radians(30.0), 0.01, 0.6, 0.01]] * 5)
    worlds, commands = studied(belief_of_draws(TABLE, WHEEL, rows))
    assert set(worlds.classes()) == {ModelClass.ANISOTROPIC}
    assert len(commands) == 4
    along = [twist for twist in commands.twists if twist[2] == 0.0]
    assert all(abs(math.tan(math.atan2(y, x)) - math.tan(math.radians(30.0))) < 1e-9 for x, y, _ in along)
    assert all(centre_of(t) == pytest.approx([0.2, -0.4]) for t in commands.twists if t[2] != 0.0)


def test_a_pinned_thing_only_turns_about_its_anchor() -> None:
    _, commands = studied(pinned(TABLE, 0.3, -0.7))
    assert len(commands) == 2
    assert all(centre_of(twist) == pytest.approx([0.3, -0.7]) for twist in commands.twists)


def test_a_static_thing_does_nothing() -> None:
    worlds, commands = studied(stuck(TABLE))
    assert len(commands) == 0
    assert worlds.mobile() == 0.0
    assert commands.twists.shape == (0, 3)


def test_anchors_that_are_near_each_other_are_one_command() -> None:
    _, commands = studied(pinned(TABLE, 0.3, -0.7, spread=0.005))
    assert len(commands) == 2
    _, scattered = studied(pinned(TABLE, 0.0, 0.0, spread=0.3))
    assert len(scattered) > 10
    assert len(scattered) <= SETTINGS.commands


def test_worlds_obey_what_the_library_leaves_of_a_command() -> None:
    worlds, commands = studied(prior_belief(TABLE, np.random.default_rng(0)))
    for w, model in enumerate(worlds.models):
        for c, twist in enumerate(commands.twists):
            found = achievable_twist(model, PlanarTwist(*map(float, twist)), np.zeros(3), SETTINGS.constraints)
            assert commands.allowed[w, c] == pytest.approx(found.twist.array(), abs=1e-9)
            whole = math.sqrt(twist @ model.inertia_shape @ twist)
            assert commands.obeys[w, c] == (found.refused_speed <= SETTINGS.refused * whole + 1e-12)


def test_what_most_worlds_ask_for_comes_first() -> None:
    _, commands = studied(prior_belief(TABLE, np.random.default_rng(0)))
    free = commands.twists[:6]
    assert sum(twist[2] == 0.0 for twist in free) == 4
    few = SETTINGS.model_copy(update={"commands": 3})
    worlds = Worlds.sample(
        prior_belief(TABLE, np.random.default_rng(0)), np.zeros(3), np.random.default_rng(0), 30, few.constraints
    )
    assert np.array_equal(Commands.of(worlds, few).twists, commands.twists[:3])


@pytest.mark.parametrize(
    ("a", "b", "same"),
    [
        ((1.0, 0.0, 0.0), (math.cos(0.1), math.sin(0.1), 0.0), True),
        ((1.0, 0.0, 0.0), (math.cos(0.2), math.sin(0.2), 0.0), False),
        ((1.0, 0.0, 0.0), (-1.0, 0.0, 0.0), False),
        ((-1.0, 0.001, 0.0), (-1.0, -0.001, 0.0), True),
        ((0.5, 0.5, 1.0), (-0.5, -0.5, -1.0), False),
        ((0.5, 0.5, 1.0), (0.52, 0.5, 1.0), True),
        ((0.5, 0.5, 1.0), (0.6, 0.5, 1.0), False),
        ((1.0, 0.0, 0.0), (1.0, 0.0, 1.0), False),
    ],
)
def test_what_is_alike(a: tuple[float, ...], b: tuple[float, ...], same: bool) -> None:
    assert alike(np.array(a), np.array(b), SETTINGS) is same
    assert alike(np.array(b), np.array(a), SETTINGS) is same


def test_drives_are_what_a_base_can_do() -> None:
    base = np.array([-1.1, 0.3, 0.2])
    drives = drives_of(base, (0.8, 1.6))
    assert len(drives) == 6 + 8
    ahead, across = np.array([np.cos(0.2), np.sin(0.2)]), np.array([-np.sin(0.2), np.cos(0.2)])
    for k, twist in enumerate(drives):
        velocity = twist[:2] + twist[2] * np.array([-base[1], base[0]])
        assert k in (2, 3) or abs(velocity @ across) < 1e-9  # but for the two aside, no base is carried sideways
        if k > 5:
            assert abs(velocity @ ahead) / abs(twist[2]) == pytest.approx(0.8 if k < 10 else 1.6)
        assert drives[k ^ 1] == pytest.approx(-twist)
    assert drives[4] == pytest.approx(-drives[5])
    assert len(drives_of(base, ())) == 6
