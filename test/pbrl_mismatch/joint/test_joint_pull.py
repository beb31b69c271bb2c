"""A hinge and the force along the path, from a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pbrl_bag.types import BodyGeometry, Grasp, PoseStream, Recording, WrenchStream
from pbrl_mismatch.errors import MismatchError
from pbrl_mismatch.joint.diagnosis import diagnose_doors, is_for_doors
from pbrl_mismatch.joint.pull import pull_of
from pbrl_mismatch.options import DiagnoseOptions

CENTRE, RADIUS, FORCE, OUTWARD = np.array([1.0, -0.6]), 0.35, 4.0, 7.0


def recorded(sense: float = 1.0, degrees: float = 80.0, force: float = FORCE) -> Recording:
    """Return a door that is pulled with a steady force along its path, and one outwards that the hinge bears."""
    time = np.linspace(0.0, 10.0, 600)
    turn = 0.7 + sense * np.radians(degrees) * time / 10.0
    outward = np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    along = sense * np.column_stack([-np.sin(turn), np.cos(turn), np.zeros_like(turn)])
    place = np.array([*CENTRE, 0.1]) + RADIUS * outward
    unseen = np.full((600, 4), np.nan)
    outline = 0.02 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    felt = force * along + (OUTWARD if force else 0.0) * outward
    return Recording(
        Path("door.csv"),
        {"door": BodyGeometry("door", outline, 0.4, 2.0, True, np.zeros(3))},
        {"door": PoseStream(time, place, unseen)},
        {"right": PoseStream(time, place, unseen)},
        {"right": WrenchStream(time, felt, np.full((600, 3), np.nan), "object", "world")},
        (Grasp("right", "door", 0.0, 10.0, np.zeros(2)),),
    )


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_force_along_the_path_is_told_from_what_the_hinge_bears(sense: float) -> None:
    pull = pull_of(recorded(sense), "door")
    assert pull.hinge.centre == pytest.approx(CENTRE, abs=1e-4)
    assert pull.hinge.radius == pytest.approx(RADIUS, abs=1e-4) and pull.hinge.sense == sense
    assert pull.force == pytest.approx(FORCE, abs=0.02) and pull.across == pytest.approx(OUTWARD, abs=0.02)
    assert np.degrees(pull.reach) == pytest.approx(80.0, abs=0.5) and (np.diff(pull.angle) > 0.0).all()


def test_only_paths_with_forces_are_for_doors() -> None:
    recording = recorded()
    assert is_for_doors(recording, None) and is_for_doors(recording, ("hinge",))
    assert not is_for_doors(recording, ("free",)) and not is_for_doors(recording, ("hinge", "free"))
    felt = recording.wrenches["right"]
    turned = WrenchStream(felt.time, felt.force, np.zeros_like(felt.force), felt.exerted_on, felt.frame)
    other = Recording(
        recording.path,
        recording.bodies,
        recording.object_poses,
        recording.gripper_poses,
        {"right": turned},
        recording.grasps,
    )
    assert not is_for_doors(other, ("hinge",))


def test_a_door_that_hardly_moves_is_refused() -> None:
    with pytest.raises(MismatchError, match="expected a door opened by at least 10 degrees"):
        pull_of(recorded(degrees=4.0), "door")


def test_a_door_without_force_is_refused() -> None:
    with pytest.raises(MismatchError, match="expected a force while it was pulled, got zero"):
        pull_of(recorded(force=0.0), "door")


def test_an_object_that_was_not_held_is_refused() -> None:
    with pytest.raises(MismatchError, match="expected objects that were held"):
        diagnose_doors(recorded(), DiagnoseOptions(baseline=("hinge",), objects=("window",)))
