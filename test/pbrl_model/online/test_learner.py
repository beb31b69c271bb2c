"""Learning as data come: what a fit at once says, sooner; sure only of what was seen; ready to change its mind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pbrl_bag.types import Recording, WrenchStream
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import FitOptions, fit_recording
from pbrl_model.inference import smc
from pbrl_model.online.cloud import absorb, search
from pbrl_model.online.learner import OnlineLearner, OnlineOptions, adopted
from pbrl_model.online.memory import target_of
from pbrl_model.parameters import BodyParameters
from pbrl_model.posterior import Posterior

Maker = Callable[..., Recording]
HeardBy = Callable[[Recording, float], Recording]
OPTIONS = OnlineOptions(particles=150)
MANY = 600
"""Particles where means are compared: with 150, seeds are a quarter of a deviation apart."""
TIMES = np.arange(3.0, 13.0, 0.75).tolist()
COMPARED = ("mass", "wheel_x", "wheel_y", "mu_ground")
SECONDS = 9.3
WHOLE = 9.0
"""[s] of six whole windows, for both the same: over 9.3 s, other windows alone move a mean by 1.3 deviations."""


@pytest.fixture(scope="module")
def recording(make_recording: Maker) -> Recording:
    return make_recording(0, seconds=SECONDS, rolling=6.0)


def fed(recording: Recording, heard_by: HeardBy, options: OnlineOptions, times: list[float]) -> list[Posterior]:
    """Feed a recording as far as each time, the last of which is its end; return the posteriors on the way."""
    learner, found = OnlineLearner(options), []
    for time in times:
        if learner.update(heard_by(recording, time), at_the_end=time == times[-1]):
            found.append(learner.posteriors()["table"])
    return found


@pytest.fixture(scope="module")
def on_the_way(recording: Recording, heard_by: HeardBy) -> list[Posterior]:
    return fed(recording, heard_by, OPTIONS, TIMES)


def deviations(posterior: Posterior) -> dict[str, float]:
    return dict(zip(posterior.names, posterior.sd().tolist(), strict=True))


def test_in_the_end_it_says_what_a_fit_at_once_says(make_recording: Maker, heard_by: HeardBy) -> None:
    recording = make_recording(0, seconds=WHOLE, rolling=6.0)
    at_once = fit_recording(recording, FitOptions(holdout_share=0.0)).objects["table"].posterior
    last = fed(recording, heard_by, replace(OPTIONS, particles=MANY), TIMES)[-1]
    spread, other = deviations(last), deviations(at_once)
    for name in COMPARED:
        difference = abs(float(last.column(name).mean() - at_once.column(name).mean()))
        assert difference < 1.2 * other[name], name
        assert 0.5 < spread[name] / other[name] < 2.0, name
    assert last.log_evidence == pytest.approx(at_once.log_evidence, rel=0.05)


def test_it_is_sooner_and_grows_surer(on_the_way: list[Posterior]) -> None:
    assert len(on_the_way) >= 5
    first, last = on_the_way[0], on_the_way[-1]
    for name in ("mass", "wheel_x", "wheel_y"):
        assert deviations(last)[name] < 0.8 * deviations(first)[name]
    place = np.array([last.column(name).mean() for name in ("wheel_x", "wheel_y")])
    assert np.linalg.norm(place - [-0.65, 0.3]) < 0.03
    assert last.draws.shape == (1, OPTIONS.particles, len(last.names))


def test_same_seed_same_bytes(make_recording: Maker, heard_by: HeardBy) -> None:
    short = make_recording(1, seconds=5.0)
    options = [replace(OPTIONS, particles=60, fit=FitOptions(seed=seed)) for seed in (1, 1, 2)]
    draws = [fed(short, heard_by, one, [6.3, 9.0])[-1].draws.tobytes() for one in options]
    assert draws[0] == draws[1] != draws[2]


def test_windows_in_one_go_or_one_by_one(recording: Recording) -> None:
    """IBIS from the same first posterior: evidence and means agree within Monte-Carlo error."""
    learner = OnlineLearner(OPTIONS)
    learner.update(recording, at_the_end=True)
    learned = learner.objects["table"].learned
    windows = learned.windows
    assert windows is not None and len(windows) == 6
    rows = [windows.take(np.arange(first, last)) for first, last in ((0, 2), (2, 6), (2, 3), (3, 4), (4, 5), (5, 6))]
    options = smc.Options(wanted_moves=5.0, most_sweeps=30)
    rng = np.random.default_rng(0)
    target = target_of(learned, rows[0], OPTIONS.fit)
    first = search(rng, target, learned.motions, 300, options=options)
    at_once = absorb(rng, first, rows[1], first.windows, options)
    one_by_one = first
    for part in rows[2:]:
        one_by_one = absorb(rng, one_by_one, part, one_by_one.windows, options)
    assert one_by_one.cloud.log_evidence == pytest.approx(at_once.cloud.log_evidence, abs=1.0)
    means, spreads = (
        np.array([getattr(one.positions(), kind)(axis=0) for one in (at_once, one_by_one)]) for kind in ("mean", "std")
    )
    compared = [target.names.index(name) for name in COMPARED]
    assert np.all(np.abs(means[0] - means[1])[compared] < 0.6 * spreads.mean(axis=0)[compared])


def test_a_fit_at_once_is_gone_on_from(recording: Recording, make_recording: Maker) -> None:
    found = fit_recording(recording, FitOptions(draws=60)).objects["table"]
    learned = adopted(found, recording.bodies["table"], OPTIONS)
    assert learned.tracked is not None and learned.windows is not None
    assert len(learned.windows) == len(learned.tracked.windows) < 7
    assert learned.tracked.cloud.log_evidence == found.posterior.log_evidence
    columns = [learned.tracked.target.names.index(name) for name in COMPARED]
    draws = np.stack([found.posterior.column(name).ravel() for name in COMPARED], -1)
    taken = learned.tracked.positions()[:, columns]
    assert np.all(np.abs(taken.mean(axis=0) - draws.mean(axis=0)) < 0.5 * draws.std(axis=0))
    learner = OnlineLearner(OPTIONS)
    learner.resume(learned, found.posterior, OPTIONS.fit)
    assert learner.update(make_recording(4, seconds=3.2), at_the_end=True) == ("table",)
    after = learner.posteriors()["table"]
    assert deviations(after)["wheel_x"] < 1.2 * deviations(found.posterior)["wheel_x"]


def test_data_that_change_change_the_mind(make_recording: Maker) -> None:
    """Another caster is locked in the second episode, and the first is beyond what is kept."""
    learner = OnlineLearner(replace(OPTIONS, most_windows=5))
    places = np.array([[-0.65, 0.3], [0.65, -0.3]])
    for number, place in enumerate(places):
        truth = BodyParameters(mass=33.0, wheel_x=place[0], wheel_y=place[1], mu_x=0.4, mu_y=0.4)
        learner.new_clock()
        learner.update(make_recording(7 + number, seconds=9.0, rolling=4.0, truth=truth), at_the_end=True)
        posterior = learner.posteriors()["table"]
        columns = np.stack([posterior.column(name).ravel() for name in ("wheel_x", "wheel_y")], -1)
        off = np.abs(columns.mean(axis=0) - place)
        assert np.all(off < 3.0 * columns.std(axis=0)) and np.linalg.norm(off) < 0.2
    learned = learner.objects["table"].learned
    assert learned.windows is not None
    assert (len(learned.windows), learned.seen, learned.episodes) == (5, 12, 2)


def test_nothing_felt_is_no_posterior(recording: Recording) -> None:
    felt = recording.wrenches["left"]
    numb = replace(recording, wrenches={"left": WrenchStream(felt.time, 0.0 * felt.force, 0.0 * felt.torque)})
    learner = OnlineLearner(OPTIONS)
    assert learner.update(numb, at_the_end=True) == ()
    assert "is the wrist sensor on?" in learner.objects["table"].reason and not learner.posteriors()


def test_what_does_not_move_says_so(make_recording: Maker) -> None:
    stuck = BodyParameters(mass=33.0, wheel_x=0.0, wheel_y=0.0, mu_x=0.9, mu_y=0.9)
    learner = OnlineLearner(OPTIONS)
    learner.update(make_recording(2, seconds=9.3, truth=stuck, speed=0.002), at_the_end=True)
    posterior = learner.posteriors()["table"]
    assert any(note.startswith("the data do not say how table moves") for note in posterior.notes)


def test_too_little_is_waited_for(recording: Recording, heard_by: HeardBy) -> None:
    learner = OnlineLearner(OPTIONS)
    assert learner.update(heard_by(recording, 4.8)) == ()
    assert learner.objects["table"].learned.seen == 1 and learner.objects["table"].reason == ""
    assert learner.update(heard_by(recording, 2.2)) == ()


def test_only_what_is_asked_for_and_only_what_has_a_shape(recording: Recording) -> None:
    chairs = OnlineLearner(replace(OPTIONS, fit=FitOptions(objects=("chair",))))
    assert chairs.update(recording, at_the_end=True) == () and not chairs.objects
    learner = OnlineLearner(OPTIONS)
    learner.update(replace(recording, bodies={}), at_the_end=True)
    assert not learner.objects


def test_another_shape_of_that_name_begins_anew(recording: Recording, heard_by: HeardBy) -> None:
    learner = OnlineLearner(OPTIONS)
    learner.update(heard_by(recording, 4.8))
    body = recording.bodies["table"]
    learner.update(replace(heard_by(recording, 2.4), bodies={"table": replace(body, footprint=1.1 * body.footprint)}))
    assert learner.objects["table"].learned.seen == 0


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"particles": 10}, "at least 50 particles"),
        ({"most_windows": 1}, "at least 4 windows"),
        ({"fit": FitOptions(likelihood="one_step")}, "windowed likelihood, got 'one_step'"),
    ],
)
def test_options_out_of_range_are_refused(fields: dict, words: str) -> None:
    with pytest.raises(ModelError, match=words):
        OnlineOptions(**fields)
