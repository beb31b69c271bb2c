"""People: their ways, their manners, and what touches them."""

from __future__ import annotations

import numpy as np
import pytest

from bullet_sim.client import BulletClient
from pr2_cart_sim.people import TICK, Crowd, Lead, Nearness, Walker
from pr2_cart_sim.person_body import PersonBody
from pr2_cart_sim.scene import Manners, Person

FAR = Lead(np.array([50.0, 50.0]), np.array([1.0, 0.0]), 0.0)


@pytest.fixture
def client():
    with BulletClient() as made:
        yield made


def walker(client, person: Person, **manners) -> Walker:
    body = PersonBody(client, f"person_{len(client.bodies)}", person, 0)
    return Walker(body, person, Manners(**manners), np.random.default_rng(3))


def test_a_walk_goes_through_every_place_of_the_route_and_back(client):
    route = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0))
    one = walker(client, Person(route=route, speed=1.0, pause=0.0))
    trail = []
    for _ in range(1400):
        one.move(None)
        trail.append(one.place)
    steps = np.hypot(*np.diff(trail, axis=0).T)
    assert steps.max() <= 1.0 * TICK + 1e-9
    for place in route:
        visits = np.hypot(*(np.array(trail) - place).T) < 0.06
        assert np.count_nonzero(np.diff(visits.astype(int)) == 1) >= 2, place


def test_a_pause_at_the_ends_only(client):
    one = walker(client, Person(route=((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)), speed=1.0, pause=2.0))
    still = []
    for _ in range(3000):
        before = one.place
        one.move(None)
        if np.array_equal(before, one.place):
            still.append(one.place[0])
    # A tick is spent at each place to turn to the next.
    middle = [x for x in still if 0.5 < x < 1.5]
    assert len(middle) < 20 < len(still)


def test_who_has_manners_walks_past_a_cart_and_not_into_it(client):
    """A doorway: the cart's front is 0.35 m ahead and a little aside, the way back into the room leads past it."""
    cart = np.array([0.35, 0.08])
    one = walker(client, Person(route=((0.0, 0.0), (0.0, 2.0)), speed=1.0, pause=0.0), social=True, patience=2.0)
    one.place, one._next = np.array([0.0, 0.0]), 1
    nearest = np.inf
    for _ in range(150):
        off = cart - one.place
        gap = float(np.hypot(*off))
        nearest = min(nearest, gap)
        one.move(Nearness(gap, tuple(off / gap)))
    assert one.place[1] > 1.0 and nearest > 0.3
    into = walker(client, Person(route=((0.0, 0.0), (1.0, 0.0)), speed=1.0, pause=0.0), social=True, patience=1e3)
    into.place, into._next = np.array([0.0, 0.0]), 1
    for _ in range(150):
        off = cart + np.array([0.5, 0.0]) - into.place
        gap = float(np.hypot(*off))
        into.move(Nearness(gap, tuple(off / gap)))
    assert gap == pytest.approx(0.4, abs=0.03), "straight at it they stop at their margin"


@pytest.mark.parametrize("social", [True, False])
def test_manners_decide_how_near_they_come(client, social):
    one = walker(client, Person(route=((0.0, 0.0), (5.0, 0.0)), speed=1.0, pause=0.0), social=social, patience=1000.0)
    one.place, one._next = np.array([0.0, 0.0]), 1
    for _ in range(600):
        gap = 3.0 - float(one.place[0])
        one.move(Nearness(gap, (1.0, 0.0)))
    gap = 3.0 - float(one.place[0])
    assert gap == pytest.approx(0.40 if social else 0.01, abs=0.011)


@pytest.mark.parametrize("room", [True, False])
def test_who_is_backed_up_to_steps_back_where_there_is_room(client, room):
    one = walker(client, Person(route=((0.0, 0.0), (0.001, 0.0)), speed=1.0, pause=1e3), social=True)
    one.place, behind, gaps = np.array([0.0, 0.0]), 0.6, []
    for _ in range(400):
        behind -= 0.3 * TICK
        gap = behind - float(one.place[0])
        gaps.append(gap)
        one.move(Nearness(gap, (1.0, 0.0)), lambda way: room)
    assert (min(gaps) > 0.19) == room
    assert (one.place[0] < -0.5) == room


def test_who_has_a_wall_behind_steps_aside(client):
    one = walker(client, Person(route=((0.0, 0.0), (0.001, 0.0)), speed=1.0, pause=1e3), social=True)
    one.place, behind, gaps = np.array([0.0, 0.0]), 0.6, []
    for _ in range(400):
        behind -= 0.3 * TICK
        off = np.array([behind, 0.0]) - one.place
        gaps.append(float(np.hypot(*off)))
        one.move(Nearness(gaps[-1], tuple(off / gaps[-1])), lambda way: way[0] > -0.4)
    assert min(gaps) > 0.15 and abs(one.place[1]) > 0.1


def test_who_stands_beside_a_cart_that_does_not_pass_gives_it_room_and_walks_on(client):
    """Both ways along the corridor lead a little towards the cart, 0.15 m to the side: they waited for each other."""
    one = walker(client, Person(route=((-2.0, 0.1), (2.0, 0.1)), speed=1.0, pause=1e3), social=True)
    one.place, one._next = np.array([0.0, 0.0]), 1
    for _ in range(400):
        gap = float(np.hypot(max(abs(one.place[0]) - 0.5, 0.0), 0.15 - one.place[1]))
        towards = np.array([np.clip(one.place[0], -0.5, 0.5), 0.15]) - one.place
        one.move(Nearness(gap, tuple(towards / gap)))
    assert one.place[0] == pytest.approx(2.0, abs=0.06)


def test_they_go_away_from_what_is_near(client):
    one = walker(client, Person(route=((0.0, 0.0), (5.0, 0.0)), speed=1.0, pause=0.0))
    one.place, one._next = np.array([1.0, 0.0]), 1
    one.move(Nearness(0.1, (-1.0, 0.0)))
    assert one.place[0] > 1.0


def test_patience_ends(client):
    one = walker(client, Person(route=((0.0, 0.0), (5.0, 0.0)), speed=1.0, pause=0.0), patience=1.0)
    one.place, one._next = np.array([2.0, 0.0]), 1
    for _ in range(300):
        one.move(Nearness(3.0 - float(one.place[0]) - 0.9, (1.0, 0.0)))
    assert one.place[0] < 1.0


def test_somebody_steps_in_front_stands_and_goes_back(client):
    one = walker(client, Person(route=((0.0, 2.0),)), stand=1.0)
    one.step_in(np.array([1.0, 0.0]))
    trail = []
    for _ in range(900):
        one.move(None)
        trail.append(one.place)
    trail = np.array(trail)
    there = np.hypot(*(trail - [1.0, 0.0]).T) < 0.06
    assert 0.9 < np.count_nonzero(there) * TICK < 1.4
    assert np.hypot(*(one.place - [0.0, 2.0])) < 0.06


def test_nobody_is_tempted_by_a_robot_that_stands(client):
    people = {"ann": Person(route=((0.0, 0.0),))}
    crowd = Crowd(client, people, Manners(step_in_rate=6000.0), np.random.default_rng(1))
    crowd.move({}, Lead(np.array([1.0, 0.0]), np.array([1.0, 0.0]), 0.0))
    assert not crowd.walkers["ann"].errand
    crowd.move({}, Lead(np.array([1.0, 0.0]), np.array([1.0, 0.0]), 0.3))
    assert crowd.walkers["ann"].errand


def test_adding_somebody_changes_nobody_else(client):
    routes = {"ann": ((0.0, 0.0), (4.0, 0.0)), "bob": ((0.0, 3.0), (4.0, 3.0))}
    trails = []
    for names in (("ann",), ("ann", "bob")):
        with BulletClient() as other:
            people = {name: Person(route=routes[name]) for name in names}
            crowd = Crowd(other, people, Manners(), np.random.default_rng(5))
            for _ in range(300):
                crowd.move({}, FAR)
            trails.append(crowd.walkers["ann"].place)
    np.testing.assert_array_equal(*trails)


def test_the_cart_that_is_driven_into_somebody_is_a_contact(make_scene, make_session, run):
    ann = {"route": [[1.9, 0.0]], "legs": True}
    session = make_session(make_scene(people={"ann": ann}, manners={"social": False}))
    run(session, 0.8, lambda: session.command_base(0.4, 0.0, 0.0))
    contact = session.contacts[0]
    assert (contact.mover, contact.other, contact.person) == ("cart", "ann", True)
    assert contact.peak > 0
    assert session.clearance.person < 1e-3
    assert session.truth("cart").planar[0] < 1.9 - 0.5 - 0.1  # people are not pushed aside


def test_a_wall_and_furniture_that_are_touched_are_contacts_with_nobody(make_scene, make_session, run):
    square = [[0, 0], [0.3, 0], [0.3, 0.3], [0, 0.3]]
    post = {"kind": "fixture", "polygon": square, "height": 1.0, "pose": [1.75, -0.15, 0]}
    session = make_session(make_scene(clutter={"post": post}))
    run(session, 0.8, lambda: session.command_base(0.3, 0.0, 0.0))
    (contact,) = session.contacts
    assert (contact.mover, contact.other, contact.person) == ("cart", "post", False)
    assert contact.peak > 0
    assert session.clearance.people == {}


def test_clearance_is_the_gap_to_people_and_things(make_scene, make_session, run):
    post = {
        "kind": "fixture",
        "polygon": [[0, 0], [0.3, 0], [0.3, 0.3], [0, 0.3]],
        "height": 1.0,
        "pose": [1.0, 0.6, 0],
    }
    person = {"route": [[2.3, 0.0]], "radius": 0.2, "depth": 0.2}
    session = make_session(make_scene(clutter={"post": post}, people={"ann": person}))
    run(session, 0.2)
    assert session.clearance.person == pytest.approx(2.3 - 0.2 - 1.634, abs=0.02)
    assert session.clearance.things["post"] == pytest.approx(0.6 - 0.275, abs=0.01)
    assert session.contacts == []


def test_people_stop_before_the_robot_and_legs_are_seen_by_its_laser(make_scene, make_session, run):
    scene = make_scene(
        bodies={},
        people={"ann": {"route": [[2.0, 0.0], [2.0, 0.001]], "pause": 0.0}},
        sensors={"base_laser": {"noise": 0.0, "increment": 0.01}},
    )
    session = make_session(scene)
    scan = next(one for one in run(session, 0.06) if getattr(one, "laser", "") == "base")
    points = scan.points() + np.array([0.275, 0.0])
    on_legs = points[np.hypot(*(points - [2.0, 0.0]).T) < 0.4]
    # Two round legs of 7 cm whose axes are 12.5 cm from the middle: no more than those, and not the trunk above them.
    assert len(on_legs) > 4
    from_middle = np.hypot(*(on_legs - [2.0, 0.0]).T)
    assert ((from_middle > 0.125 - 0.08) & (from_middle < 0.125 + 0.08)).all()
