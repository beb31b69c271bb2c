"""A wheel found through contact: accuracy, invariance, determinism, and honesty where the push says nothing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pbrl_bag.types import PoseStream, Recording
from pbrl_bringup.experiments.contact import Trial, rows_of
from pbrl_bringup.experiments.contact_cases import HELD, PUSHED, Case, random_case, rotation, until
from pbrl_bringup.experiments.contact_figure import draw
from pbrl_model.contact import fit as contact_fit
from pbrl_model.contact.fit import ContactFit, ContactOptions, fit_contact
from pbrl_model.errors import ModelError
from pbrl_model.fitting import sampling

Array = NDArray[np.float64]

QUICK = ContactOptions(draws=500, search_draws=300, pair=False)


@pytest.fixture(scope="module")
def case() -> Case:
    return random_case(0)


@pytest.fixture(scope="module")
def fit(case: Case) -> ContactFit:
    return fit_contact(case.recordings[0], PUSHED, QUICK)


def _moved(recording: Recording, angle: float, shift: Array) -> Recording:
    """Return what would have been recorded in another corner of the room."""
    half = np.array([0.0, 0.0, np.sin(angle / 2.0), np.cos(angle / 2.0)])

    def poses(stream: PoseStream) -> PoseStream:
        position = stream.position.copy()
        position[:, :2] = position[:, :2] @ rotation(angle).T + shift
        z, w = stream.quaternion[:, 2], stream.quaternion[:, 3]
        quaternion = np.zeros_like(stream.quaternion)
        quaternion[:, 2], quaternion[:, 3] = w * half[2] + z * half[3], w * half[3] - z * half[2]
        return PoseStream(stream.time, position, quaternion)

    return replace(
        recording,
        object_poses={name: poses(stream) for name, stream in recording.object_poses.items()},
        gripper_poses={name: poses(stream) for name, stream in recording.gripper_poses.items()},
    )


def test_a_case_is_the_same_for_the_same_seed(case: Case) -> None:
    again = random_case(0)
    for first, second in zip(case.recordings, again.recordings, strict=True):
        assert first.object_poses[PUSHED].position.tobytes() == second.object_poses[PUSHED].position.tobytes()
        assert first.wrenches["left"].force.tobytes() == second.wrenches["left"].force.tobytes()
    assert random_case(1).truth != case.truth


def test_a_case_is_informative_and_tells_no_truth(case: Case) -> None:
    assert case.moved >= 0.10 or case.turned >= np.deg2rad(10.0)
    told = case.recordings[1].bodies[PUSHED]
    assert told.casters.size == 0
    assert told.nominal_mass != case.truth.pushed.mass
    assert set(case.recordings[1].wrenches) == {"left"}
    assert {grasp.object for grasp in case.recordings[1].grasps} == {HELD}


def test_the_wheel_is_found_and_the_spread_is_honest(case: Case, fit: ContactFit) -> None:
    error = float(np.hypot(*(fit.wheel - case.truth.wheel)))
    assert error < 0.05
    assert fit.found
    assert error < 3.0 * fit.radius
    assert fit.level(fit.wheel) < 0.5 < fit.level(fit.wheel + 4.0 * fit.radius)


def test_the_held_table_is_weighed_before_it_touches(case: Case, fit: ContactFit) -> None:
    assert fit.held.parameters.mass == pytest.approx(case.truth.held.mass, rel=0.1)
    assert fit.held.parameters.mu_ground == pytest.approx(case.truth.held.mu_ground, abs=0.01)


def test_moving_the_scene_changes_nothing(case: Case, fit: ContactFit) -> None:
    # By a quarter turn: x and y are smoothed each on its own, and the noise found in them is not that of other axes.
    elsewhere = fit_contact(_moved(case.recordings[0], np.pi / 2.0, np.array([4.0, -3.0])), PUSHED, QUICK)
    assert np.hypot(*(elsewhere.wheel - fit.wheel)) < 0.3 * fit.radius
    assert elsewhere.held.parameters.mass == pytest.approx(fit.held.parameters.mass, rel=0.02)


def test_where_weights_collapse_the_draws_are_those_of_chains_as_the_note_says(
    case: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sampling, "ENOUGH", 1e9)
    monkeypatch.setattr(sampling, "ATTEMPTS", 1)
    monkeypatch.setattr(contact_fit, "CHAINS", {"count": 4, "burn_in": 50, "thin": 1})
    found = fit_contact(case.recordings[0], PUSHED, replace(QUICK, search_draws=30))
    assert any("the draws are those of Metropolis chains" in note for note in found.notes)
    assert found.posterior.draws.shape[:2] == (4, 125) and np.isnan(found.posterior.log_evidence)


def test_same_seed_same_bytes(case: Case, fit: ContactFit) -> None:
    again = fit_contact(case.recordings[0], PUSHED, QUICK)
    assert again.posterior.draws.tobytes() == fit.posterior.draws.tobytes()
    assert again.notes == fit.notes


def test_late_poses_are_put_right(case: Case, fit: ContactFit) -> None:
    def late(stream: PoseStream) -> PoseStream:
        return replace(stream, time=stream.time + 0.1)

    given = case.recordings[0]
    shifted = replace(
        given,
        object_poses={name: late(stream) for name, stream in given.object_poses.items()},
        gripper_poses={name: late(stream) for name, stream in given.gripper_poses.items()},
    )
    found = fit_contact(shifted, PUSHED, QUICK)
    assert found.touches[0].held.delay == pytest.approx(0.1, abs=0.015)
    assert np.hypot(*(found.wheel - fit.wheel)) < fit.radius


def test_a_sensor_that_was_off_is_an_error(case: Case) -> None:
    given = case.recordings[0]
    stream = given.wrenches["left"]
    off = replace(stream, force=np.zeros_like(stream.force), torque=np.zeros_like(stream.torque))
    with pytest.raises(ModelError, match="expected a force while it was held, got zero"):
        fit_contact(replace(given, wrenches={"left": off}), PUSHED, QUICK)


def test_no_force_acts_where_they_are_apart(fit: ContactFit) -> None:
    for touch in fit.touches:
        apart = np.minimum(touch.gap[1:], touch.gap[:-1]) > 0.02
        assert np.all(touch.pushed.wrench[apart] == 0.0)
        assert np.abs(touch.pushed.wrench).max() > 5.0


def test_a_push_that_ends_at_once_says_so(case: Case, fit: ContactFit) -> None:
    touched = fit.touches[0].held.time[np.argmax(fit.touches[0].gap < 0.01)]
    short = fit_contact(until(case.recordings[0], float(touched) + 0.35), PUSHED, QUICK)
    assert not short.found
    assert any("does not say where the wheel is" in note for note in short.notes)
    assert short.radius > 3.0 * fit.radius


def test_the_pair_is_learned_or_said_not_to_be(case: Case) -> None:
    fit = fit_contact(case.recordings[0], PUSHED, replace(QUICK, pair=True))
    report = fit.to_report()["parameters"]
    for name in ("restitution", "contact_friction"):
        assert report[name]["unit"] == "1"
        assert 0.0 <= report[name]["mean"] <= 1.0
        vague = report[name]["sd"] > 0.15
        assert vague == any(name in note for note in fit.notes)


def test_tables_that_never_touch_are_an_error(case: Case, fit: ContactFit) -> None:
    before = until(case.recordings[0], float(fit.touches[0].held.time[0]))
    with pytest.raises(ModelError, match=r"expected square_table to touch long_table, it came no nearer than 0\.\d+ m"):
        fit_contact(before, PUSHED, QUICK)


@pytest.mark.parametrize("name", [HELD, "sofa"])
def test_only_a_known_body_that_nobody_holds_can_be_learned(case: Case, name: str) -> None:
    with pytest.raises(ModelError, match="contact: expected"):
        fit_contact(case.recordings[0], name, QUICK)


@pytest.mark.parametrize("wrong", [{"window": 0.0}, {"draws": 3}, {"left_out_force": float("nan")}, {"seed": -1}])
def test_options_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ModelError, match="contact options: expected"):
        ContactOptions(**wrong)  # type: ignore[arg-type]


def _trial(error: float, radius: float, inside: bool) -> Trial:
    known = (0.3, 0.1, 0.3)
    return Trial(0, 1, error, radius, inside, error, radius, inside, known, 1.0, ())


def test_rows_hold_only_for_nine_of_ten() -> None:
    good, bad = _trial(0.01, 0.03, True), _trial(0.2, 0.4, True)
    assert rows_of([good] * 9 + [bad])[0].holds
    share = rows_of([good] * 8 + [bad] * 2)[0]
    assert not share.holds
    assert share.value == pytest.approx(0.8)
    assert share.against["after_one_push_where_it_seemed_enough"] == 1.0


def test_the_figure_is_drawn(case: Case, fit: ContactFit, tmp_path: Path) -> None:
    draw(tmp_path / "figure.png", case, 1, fit.wheels, [0.01, 0.2], [0.01, 0.02], 0.05)
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
