"""The cases of the bench kills: every state and node has its share, and every case is done once."""

from __future__ import annotations

from collections import Counter

from bullet_sim.scene import Scene
from bullet_sim.settings import parse_settings
from pbrl_bag.yaml_text import parse_yaml
from pbrl_bringup.kills.cases import NODES, ORDER, SCENES, STATES, TOGETHER, draw_cases, lives_of, scene_text
from pbrl_namo.executive.table import State


def test_every_state_but_one_and_every_node_are_met_about_as_often() -> None:
    cases = draw_cases(3, 200)
    states, pairs = Counter(case.state for case in cases), Counter((case.state, case.node) for case in cases)
    assert set(State) - set(states) == {State.RELEASE_AND_FAIL}
    assert max(states.values()) - min(states.values()) <= 1
    assert len(pairs) == len(STATES) * len(NODES)


def test_the_same_seed_draws_the_same_cases_and_more_of_them_go_on_with_these() -> None:
    assert draw_cases(5, 20) == draw_cases(5, 40)[:20]
    assert draw_cases(5, 20) != draw_cases(6, 20)


def test_every_case_is_in_one_graph_in_the_order_in_which_a_mission_gets_there() -> None:
    cases = draw_cases(1, 97)
    lives = lives_of(cases)
    assert sorted(case.number for life in lives for case in life) == list(range(97))
    for life in lives:
        order = ORDER[life[0].room]
        places = [order.index(case.state) for case in life]
        assert {case.room for case in life} == {life[0].room}
        assert places == sorted(places) and len(places) <= TOGETHER[life[0].room]


def test_every_room_is_a_scene() -> None:
    for room in SCENES:
        parse_settings(parse_yaml(scene_text(room)), Scene, room)
