"""Mapping files: what is accepted, and that what is not says why in one line."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pbrl_bag import BagError, load_mapping

MAPPINGS = Path(__file__).resolve().parents[2] / "config" / "mappings"
GOOD = {
    "bodies": {"door": {"footprint": [[0, 0], [1, 0], [1, 1]], "height": 1.0, "theta": 0.0}},
    "object_poses": {"door": {"topic": "/door"}},
    "wrenches": {"left": {"topic": "/ft", "exerted_on": "gripper"}},
    "grasps": [{"gripper": "left", "object": "door"}],
}


def refusal(tmp_path: Path, text: str) -> str:
    path = tmp_path / "mapping.yaml"
    path.write_text(text)
    with pytest.raises(BagError) as caught:
        load_mapping(path)
    message = str(caught.value)
    assert "\n" not in message
    assert "mapping.yaml" in message
    return message


def changed(path: str, value: object) -> str:
    """The good mapping with one value set, dotted path, as YAML."""
    data = yaml.safe_load(yaml.safe_dump(GOOD))
    inner = data
    *parents, last = path.split(".")
    for key in parents:
        inner = inner[int(key)] if isinstance(inner, list) else inner.setdefault(key, {})
    inner[last] = value
    return yaml.safe_dump(data)


@pytest.mark.parametrize("path", sorted(MAPPINGS.glob("*.yaml")), ids=lambda path: path.name)
def test_every_shipped_mapping_loads(path: Path) -> None:
    assert load_mapping(path).description


def test_there_are_mappings_for_csv_and_for_bags() -> None:
    loaded = [load_mapping(path) for path in MAPPINGS.glob("*.yaml")]
    assert any(mapping.time for mapping in loaded)
    assert any(not mapping.time for mapping in loaded)


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        ("wrench", {}, ["unknown key 'wrench'", "did you mean 'wrenches'"]),
        ("object_poses.door.positon", ["a", "b", "c"], ["object_poses.door.positon", "did you mean 'position'"]),
        ("wrenches.left.exerted", "gripper", ["wrenches.left.exerted", "did you mean 'exerted_on'"]),
        ("grasps.0.objekt", "door", ["grasps.0.objekt", "did you mean 'object'"]),
        ("bodies.door.heigth", 1.0, ["bodies.door.heigth", "did you mean 'height'"]),
        ("frames.map.positions", [0, 0, 0], ["frames.map.positions", "did you mean 'position'"]),
        ("wrenches.left.exerted_on", "robot", ["wrenches.left.exerted_on", "gripper", "robot"]),
        ("wrenches.middle", {"topic": "/ft", "exerted_on": "gripper"}, ["middle", "left"]),
        ("wrenches.left.sign", 2, ["wrenches.left.sign"]),
        ("object_poses.door.position", ["x", "y", "z"], ["object_poses.door", "both or neither"]),
        ("object_poses.door.frame", "map", ["frame", "'map'"]),
        ("object_poses.chair", {"topic": "/chair"}, ["'chair'", "no geometry"]),
        ("bodies.door.footprint", [[0, 0], [1, 1], [1, 0]], ["footprint", "counter-clockwise"]),
        ("bodies.door.footprint", [[0, 0], [1, 1]], ["footprint", "at least 3"]),
        ("bodies.door.height", -1.0, ["height", "greater than 0"]),
        ("bodies.door.height", float("nan"), ["height", "finite"]),
        ("grasps.0.end", -1.0, []),
        ("frames.map.quaternion", [0, 0, 0, 0], ["quaternion", "length 1"]),
        ("delimiter", ", ", ["delimiter"]),
    ],
)
def test_a_wrong_mapping_is_refused_by_key(tmp_path: Path, path: str, value: object, words: list[str]) -> None:
    if path == "grasps.0.end":
        value, words = 0.0, ["end > start"]
        text = changed("grasps.0.start", 1.0).replace("start: 1.0", "start: 1.0\n  end: 0.5")
    else:
        text = changed(path, value)
    message = refusal(tmp_path, text)
    for word in words:
        assert word in message


@pytest.mark.parametrize("text", ["", "- a\n- b\n", "a: [1", "\x00", "just words"])
def test_what_is_no_mapping_of_keys_is_refused(tmp_path: Path, text: str) -> None:
    refusal(tmp_path, text)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"nothing\.yaml.*No such file"):
        load_mapping(tmp_path / "nothing.yaml")


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=6,
)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(key=st.sampled_from(sorted([*GOOD, "frames", "room", "time", "world"])), value=values)
def test_any_value_loads_or_is_refused_in_one_line(tmp_path: Path, key: str, value: object) -> None:
    path = tmp_path / "mapping.yaml"
    path.write_text(yaml.safe_dump({**GOOD, key: value}), encoding="utf-8")
    try:
        load_mapping(path)
    except BagError as error:
        assert "\n" not in str(error)
