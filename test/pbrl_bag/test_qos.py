"""Quality of service to and from metadata.yaml, of version 9 and of older bags."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from pbrl_bag import BagError, Qos
from pbrl_bag.metadata import qos_from_text, qos_text
from pbrl_bag.qos import CHOICES, INFINITE, default_qos, qos_from_metadata
from pbrl_bag.ros.conversions import message_class, profile_from_qos, profile_that_hears, qos_from_profile

times = st.integers(0, INFINITE)
profiles = st.builds(
    Qos,
    depth=st.integers(0, 1000),
    deadline=times,
    lifespan=times,
    liveliness_lease_duration=times,
    **{key: st.sampled_from(known) for key, known in CHOICES.items()},
)


@given(offered=st.lists(profiles, max_size=3))
def test_a_profile_survives_the_metadata(offered: list[Qos]) -> None:
    assert qos_from_text(qos_text(tuple(offered)), "/topic") == tuple(offered)


def test_the_numbers_of_older_bags_are_understood() -> None:
    endless = {"sec": 9223372036, "nsec": 854775807}
    entry = {"history": 1, "depth": 1, "reliability": 1, "durability": 1, "liveliness": 1, "deadline": endless}
    assert qos_from_metadata(entry) == Qos(depth=1, durability="transient_local")
    assert qos_from_metadata({"durability": 99}).durability == "unknown"


@pytest.mark.parametrize("text", ["{", "a: 1", "[1, 2]", "- history: always", "- depth: many", "- deadline: 3"])
def test_what_is_no_list_of_profiles_is_refused(text: str) -> None:
    with pytest.raises(BagError) as caught:
        qos_from_text(text, "/topic")
    assert "\n" not in str(caught.value)


@given(
    qos=st.builds(
        Qos,
        depth=st.integers(1, 1000),
        reliability=st.sampled_from(["reliable", "best_effort"]),
        durability=st.sampled_from(["volatile", "transient_local"]),
        lifespan=st.sampled_from([INFINITE, 5_000_000_000]),
    )
)
def test_a_profile_survives_rclpy(qos: Qos) -> None:
    assert qos_from_profile(profile_from_qos(qos)) == qos


@pytest.mark.parametrize(
    ("offered", "reliability", "durability"),
    [
        (["reliable volatile"], ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
        (["reliable transient_local"], ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL),
        (["reliable volatile", "best_effort volatile"], ReliabilityPolicy.BEST_EFFORT, DurabilityPolicy.VOLATILE),
        (["reliable transient_local", "reliable volatile"], ReliabilityPolicy.RELIABLE, DurabilityPolicy.VOLATILE),
    ],
)
def test_a_recorder_asks_for_no_more_than_every_publisher_offers(
    offered: list[str], reliability: ReliabilityPolicy, durability: DurabilityPolicy
) -> None:
    made = [Qos(reliability=each.split()[0], durability=each.split()[1]) for each in offered]
    profile = profile_that_hears(made)
    assert (profile.reliability, profile.durability) == (reliability, durability)


def test_the_contracts_latched_topics_are_latched() -> None:
    assert default_qos("/scene").durability == "transient_local"
    assert default_qos("/wrist_ft/left").durability == "volatile"


def test_a_type_that_is_not_sourced_says_so() -> None:
    assert message_class("std_msgs/msg/String").__name__ == "String"
    for name in ("no_such/msg/Thing", "std_msgs/msg/Strong", "String"):
        with pytest.raises(BagError, match="source the workspace"):
            message_class(name)
