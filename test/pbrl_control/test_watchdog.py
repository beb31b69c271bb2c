"""Old commands are no commands."""

from pbrl_control.types import PlanarTwist
from pbrl_control.watchdog import Watchdog

GO = PlanarTwist(vx=0.1)


def test_a_command_counts_for_its_time_and_no_longer() -> None:
    watchdog = Watchdog(0.2)
    watchdog.feed(10.0, "table", GO)
    assert watchdog.current(10.2) == {"table": GO}
    assert watchdog.current(10.2001) == {}
    assert watchdog.current(10.1) == {}, "once forgotten it stays forgotten"


def test_each_target_has_its_own_time() -> None:
    watchdog = Watchdog(0.2)
    watchdog.feed(0.0, "left_ft", GO)
    watchdog.feed(0.15, "right_ft", GO)
    assert set(watchdog.current(0.3)) == {"right_ft"}


def test_a_clock_set_back_stops_everything() -> None:
    watchdog = Watchdog(0.2)
    watchdog.feed(100.0, "table", GO)
    assert watchdog.current(5.0) == {}


def test_a_command_without_a_time_does_not_count() -> None:
    watchdog = Watchdog(0.2)
    watchdog.feed(float("nan"), "table", GO)
    assert watchdog.current(0.0) == {}
