"""A grasp from 1.5 m away in the simulator; truth says who held the table."""

from __future__ import annotations

from pbrl_bringup.benches.control_grasps import grasp_trial


def test_a_table_is_driven_to_grasped_and_let_go() -> None:
    trial = grasp_trial(20, 0, 0.005)
    assert trial.success, trial.status
    assert trial.held == ("left", "right")
    assert min(trial.forces.values()) > 0.5
    assert max(abs(slip) for slip in trial.slips.values()) < 0.012
