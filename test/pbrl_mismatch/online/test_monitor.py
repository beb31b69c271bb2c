"""The watch: calm while the model is right, in time where it is not, the same however the stream is delivered."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.errors import BagError
from pbrl_bag.types import PoseStream, Recording, WrenchStream
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.online.monitor import Alarm, MismatchMonitor
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.significance import batch_p_value, promised_level
from pbrl_mismatch.online.slices import between, last_holds
from pbrl_model.errors import ModelError
from pbrl_model.posterior import Posterior

Make = Callable[..., Recording]
FREE = 1
"""Odd seeds have tables without a wheel."""
SECONDS = 14.0


def table(mass: float = 20.0, sd: float = 0.3) -> Posterior:
    draws = mass + sd * np.random.default_rng(0).normal(size=(1, 200, 1))
    return Posterior("table", "free", ("mass",), draws)


def watched(
    recording: Recording, posterior: Posterior, every: float = 0.5, until: float = np.inf
) -> tuple[list[tuple[float, Alarm]], MismatchMonitor]:
    """Deliver a recording piece by piece; return alarms with when they were raised."""
    monitor = MismatchMonitor()
    monitor.give({"table": posterior})
    end = min(float(recording.object_poses["table"].time[-1]) + every, until)
    alarms = []
    for now in np.arange(1.0, end, every).tolist():
        alarms += [(now, alarm) for alarm in monitor.hear(between(recording, now - monitor.needed, now))]
    return alarms, monitor


def significant(recording: Recording, posterior: Posterior) -> float:
    """When the batch test on all that was heard first gives a p-value below the level of the same promise [s]."""
    options = MonitorOptions()
    for now in np.arange(recording.grasps[0].start + 1.5, recording.grasps[-1].end, options.hop).tolist():
        if batch_p_value(recording, posterior, now, options) < promised_level(options):
            return float(now)
    return float("inf")


@pytest.fixture(scope="module")
def clean(concealed_recording: Make) -> Recording:
    return concealed_recording("clean", FREE, seconds=SECONDS)


@pytest.fixture(scope="module")
def dragged(concealed_recording: Make) -> Recording:
    return concealed_recording("floor_slope", FREE, seconds=SECONDS)


def test_a_clean_stream_is_calm(clean: Recording) -> None:
    alarms, monitor = watched(clean, table())
    one = monitor.objects["table"]
    assert not alarms and one.evidence < 0.7 * monitor.options.threshold and one.reason == ""
    assert one.tested > 3 * SECONDS


@pytest.mark.parametrize("effect", ["floor_slope", "viscous_drag", "wrench_bias", "external_force"])
def test_an_alarm_comes_within_two_seconds_of_significance(concealed_recording: Make, effect: str) -> None:
    recording = concealed_recording(effect, FREE, seconds=SECONDS)
    alarms, _ = watched(recording, table(), every=0.25)
    raised, alarm = alarms[0]
    assert raised < significant(recording, table()) + 2.0
    assert alarm.object == "table" and alarm.p_value <= MonitorOptions().false_alarm and alarm.size > 1.0
    assert alarm.time <= raised and "table" in alarm.verdict


def test_a_model_that_is_wrong_is_a_mismatch_and_one_that_is_unsure_is_not(clean: Recording) -> None:
    wrong, _ = watched(clean, table(mass=30.0), until=8.0)
    unsure, _ = watched(clean, table(mass=30.0, sd=8.0), until=8.0)
    assert wrong and not unsure


def test_before_an_alarm_rare_draws_have_their_say(clean: Recording) -> None:
    far = table(mass=30.0)
    draws = far.draws.copy()
    draws[0, ::199, 0] = 20.0  # too few for a reading of their own, too far off for the Gaussian of all
    assert not watched(clean, replace(far, draws=draws), until=8.0)[0]
    draws[0, ::199, 0] = 40.0
    assert watched(clean, replace(far, draws=draws), until=8.0)[0]


def test_before_an_alarm_the_newest_model_has_its_say(clean: Recording) -> None:
    monitor = MismatchMonitor()
    monitor.give({"table": table(mass=30.0)})
    for now in np.arange(1.0, 8.0, 0.25).tolist():
        if monitor.objects["table"].evidence > 3.0:
            monitor.give({"table": table()})
        assert not monitor.hear(between(clean, now - monitor.needed, now))
    used = monitor.objects["table"].model
    assert used is not None and used.mean()[0] == pytest.approx(20.0, abs=0.2)


def test_it_is_the_same_however_the_stream_is_delivered(dragged: Recording) -> None:
    found = []
    for every in (0.25, 0.25, 1.0):
        alarms, monitor = watched(dragged, table(), every)
        found.append((alarms[0][1], monitor.objects["table"].tested))
    assert found[0] == found[1] and found[2][1] == found[0][1]
    assert found[2][0].time == pytest.approx(found[0][0].time, abs=0.51)


def test_after_an_alarm_there_is_rest(dragged: Recording) -> None:
    alarms, _ = watched(dragged, table())
    assert len(alarms) == 1


def test_gaps_are_said_and_survived(clean: Recording) -> None:
    def without(time: np.ndarray, start: float, end: float) -> np.ndarray:
        return (time < start) | (time > end)

    felt, seen = clean.wrenches["left"], clean.object_poses["table"]
    a, b = without(felt.time, 6.0, 7.2), without(seen.time, 9.0, 10.5)
    broken = replace(
        clean,
        wrenches={"left": WrenchStream(felt.time[a], felt.force[a], felt.torque[a])},
        object_poses={"table": PoseStream(seen.time[b], seen.position[b], seen.quaternion[b])},
    )
    monitor = MismatchMonitor()
    monitor.give({"table": table()})
    reasons, tested = set(), []
    for now in np.arange(1.0, SECONDS + 1.5, 0.25).tolist():
        assert not monitor.hear(between(broken, now - monitor.needed, now))
        reasons.add(monitor.objects["table"].reason)
        tested.append(monitor.objects["table"].tested)
    assert any("apart while the object is held" in reason for reason in reasons) and "" in reasons
    assert tested[-1] > tested[len(tested) // 2]


def test_another_clock_begins_anew(clean: Recording, dragged: Recording) -> None:
    alarms, monitor = watched(clean, table())
    monitor.new_clock()
    for now in np.arange(1.0, 8.0, 0.5).tolist():
        alarms += [(now, alarm) for alarm in monitor.hear(between(dragged, now - monitor.needed, now))]
    assert len(alarms) == 1


def test_what_nobody_models_or_holds_is_not_watched(clean: Recording) -> None:
    monitor = MismatchMonitor()
    assert monitor.hear(clean) == ()
    monitor.give({"chair": replace(table(), object="chair")})
    assert monitor.hear(clean) == () and monitor.objects["chair"].tested == 0


def test_a_slice_is_the_recording_up_to_then(clean: Recording) -> None:
    cut = between(clean, 5.0, 8.0)
    assert cut.grasps[0].end == 8.0 and cut.wrenches["left"].time[-1] <= 8.0
    time = cut.wrenches["left"].time
    assert np.all((time >= 5.0) | (time <= clean.grasps[0].start + 0.5))
    whole = last_holds(clean, "table", 5.0)
    assert whole.grasps == clean.grasps and len(whole.wrenches["left"].time) == len(clean.wrenches["left"].time)


def test_two_grippers_that_take_turns_hold_it_all_along(clean: Recording) -> None:
    first = clean.grasps[0]
    half = 0.5 * (first.start + first.end)
    turns = (replace(first, end=half + 1.0), replace(first, gripper="right", start=half))
    whole = last_holds(replace(clean, grasps=turns), "table", 1.0)
    assert whole.grasps == turns and len(whole.wrenches["left"].time) == len(clean.wrenches["left"].time)
    # Two holds apart are two, whoever held.
    apart = (replace(first, end=half - 3.0), replace(first, start=half + 1.0))
    assert last_holds(replace(clean, grasps=apart), "table", 1.0).grasps == apart[1:]


def test_too_little_is_not_tested_in_a_batch(clean: Recording) -> None:
    with pytest.raises((ModelError, BagError)):
        batch_p_value(clean, table(), clean.grasps[0].start + 0.05, MonitorOptions())


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"hops": 1.0}, "unknown option 'hops'"),
        ({"false_alarm": 0.0}, "false_alarm"),
        ({"windows": (0.8,)}, "whole numbers of hops"),
        ({"forces": ()}, "forces"),
    ],
)
def test_a_wrong_option_is_refused(options: dict[str, object], word: str) -> None:
    with pytest.raises(MismatchError, match=word) as error:
        MonitorOptions(**options)
    assert "\n" not in str(error.value)
