"""Who counts as gone: whoever was silent for too long while somebody listened."""

from __future__ import annotations

import numpy as np
import pytest

from pbrl_bag.liveness import OWN_DELAY, Liveness

DT = 0.1


def looked(live: Liveness, until: float, since: float, alive: tuple[str, ...] = ()) -> list[str]:
    """Complaints of looks every `DT`; some are heard before each."""
    told = []
    for now in np.arange(since + DT, until + 0.5 * DT, DT):
        for name in alive:
            live.heard(name, now)
        told.append(live.complaint(now))
    return told


def test_nobody_is_missed_before_anything_is_watched() -> None:
    live = Liveness(("a",), 1.0)
    assert looked(live, 10.0, 0.0) == [""] * 100


def test_who_never_speaks_is_gone_when_the_patience_is_over() -> None:
    live = Liveness(("a", "b"), 1.0)
    live.begin(5.0)
    told = looked(live, 7.0, 5.0, ("b",))
    assert told[:9] == [""] * 9
    assert "a" in told[-1]
    assert "b" not in told[-1].replace("nothing of", "")
    assert told[-1] == "nothing of a for 2 s"


def test_who_speaks_again_is_back_at_once() -> None:
    live = Liveness(("a",), 1.0)
    live.begin(0.0)
    assert looked(live, 3.0, 0.0)[-1]
    live.heard("a", 3.05)
    assert live.complaint(3.1) == ""


def test_one_who_stood_still_himself_blames_nobody_who_was_there() -> None:
    live = Liveness(("a", "b"), 1.0)
    live.begin(0.0)
    assert looked(live, 3.0, 0.0, ("a",))[-1] == "nothing of b for 3 s"
    told = live.complaint(3.0 + 10.0 * OWN_DELAY)
    assert told == "nothing of b for 8 s"
    assert looked(live, 12.0, 8.0)[-1].startswith("nothing of a for 4 s, b")


def test_a_sign_of_life_that_is_older_takes_nothing_back() -> None:
    live = Liveness(("a",), 1.0)
    live.begin(5.0)
    live.heard("a", 1.0)
    live.heard("nobody asked for this", 5.0)
    assert live.complaint(5.5) == ""


@pytest.mark.parametrize("since", [0.0, 1e6])
def test_watching_anew_forgives_what_was(since: float) -> None:
    live = Liveness(("a",), 1.0)
    live.begin(since)
    assert looked(live, since + 4.0, since)[-1]
    live.begin(since + 4.0)
    assert live.complaint(since + 4.5) == ""


def test_a_clock_that_is_set_back_hides_nobodys_silence() -> None:
    live = Liveness(("a",), 1.0)
    live.begin(100.0)
    assert looked(live, 101.5, 100.0, ("a",))[-1] == ""
    assert live.complaint(0.0) == ""
    assert looked(live, 2.2, 0.0)[-1].startswith("nothing of a for 2 s")
