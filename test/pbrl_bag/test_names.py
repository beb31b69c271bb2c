"""Names in a namespace: there and back, strangers left alone, one robot to a recording."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pbrl_bag import BagError, read_recording
from pbrl_bag.names import GLOBAL, canonical, hidden, in_namespace, namespace_of, relative

TOKENS = st.from_regex(r"[a-z][a-z0-9_]{0,5}", fullmatch=True)
NAMES = st.lists(TOKENS, min_size=1, max_size=3).map(lambda tokens: "/" + "/".join(tokens))
SPACES = st.one_of(st.just(""), st.just("/"), NAMES)


@given(NAMES, SPACES)
def test_a_name_goes_into_a_namespace_and_comes_back(name: str, namespace: str) -> None:
    assert canonical(in_namespace(name, namespace), namespace) == name


@given(NAMES, NAMES)
def test_what_begins_alike_is_not_in_the_namespace(name: str, namespace: str) -> None:
    assert canonical(f"{namespace}x{name}", namespace) is None
    assert canonical(namespace, namespace) is None, "the namespace itself is no name in it"


@given(NAMES)
def test_a_relative_name_in_the_root_is_the_name(name: str) -> None:
    assert "/" + relative(name) == name
    assert [relative(one) for one in GLOBAL] == list(GLOBAL)


@given(NAMES, SPACES, TOKENS)
def test_what_is_hidden_is_hidden_in_every_namespace(name: str, namespace: str, token: str) -> None:
    assert not hidden(in_namespace(name, namespace))
    assert hidden(in_namespace(f"{name}/_{token}/status", namespace))
    assert hidden(f"/_{token}")


@pytest.mark.parametrize(
    ("topics", "namespace"),
    [
        ([], ""),
        (["/rosout", "/b/odom"], ""),
        (["/scene", "/b/scene"], ""),
        (["/b/wrist_ft/left", "/b/odom", "/clock"], "/b"),
        (["/fleet/b/ar_tags/table/pose", "/fleet/b/grasps"], "/fleet/b"),
        (["/ar_tags/scene/pose"], ""),
    ],
)
def test_the_namespace_of_a_recording(topics: list[str], namespace: str) -> None:
    assert namespace_of(topics, "bag") == namespace


def test_two_robots_are_told_apart_by_somebody_else() -> None:
    with pytest.raises(BagError, match=r"bag: expected the topics of one robot, got those of /a and /b; .*--namespace"):
        namespace_of(["/a/scene", "/b/grasps"], "bag")


def test_a_bag_of_a_robot_in_a_namespace_reads_as_one_in_the_root(
    kit: SimpleNamespace, push_bag: Path, tmp_path: Path
) -> None:
    moved = [(f"/robot_1{topic}", *rest) for topic, *rest in kit.pushing()]
    other = [("/rosout", *rest) for topic, *rest in kit.pushing() if topic == "/wrist_ft/left"]
    read = read_recording(kit.write(tmp_path / "moved", sorted(moved + other, key=lambda message: message[3])))
    root = read_recording(push_bag)
    assert read.notes == (*root.notes, "the robot's namespace /robot_1 is left out of the names of its topics")
    np.testing.assert_array_equal(read.wrenches["left"].force, root.wrenches["left"].force)
    np.testing.assert_array_equal(read.object_poses["table"].position, root.object_poses["table"].position)
    assert repr(read.grasps) == repr(root.grasps)


def test_a_bag_of_two_robots_is_refused_in_a_line(kit: SimpleNamespace, tmp_path: Path) -> None:
    both = [(f"/{robot}{topic}", *rest) for robot in ("a", "b") for topic, *rest in kit.pushing()]
    with pytest.raises(BagError, match="/a and /b") as refused:
        read_recording(kit.write(tmp_path / "both", sorted(both, key=lambda message: message[3])))
    assert "\n" not in str(refused.value)
