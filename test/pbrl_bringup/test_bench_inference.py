"""What the bench of inference makes of its measurements; the other samplers are not run here."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from pbrl_bringup.benches import inference
from pbrl_bringup.benches.inference import Ours, evidence_row, metropolis_row, route_rows, ultranest_row
from pbrl_bringup.benches.inference_case import TRUTH, second_share
from pbrl_bringup.errors import BringupError


def ours(**change: float) -> Ours:
    sound = {
        "seed": 0,
        "cpu": 0.5,
        "calls": 30_000,
        "ess": 2000.0,
        "log_evidence": 6307.76,
        "log_evidence_sd": 0.02,
        "pareto_k": 0.4,
        "second": 0.5,
        "converged": True,
    }
    return Ours(**(sound | change))  # type: ignore[arg-type]


PEER = {
    "cpu": 100.0,
    "cpu_likelihood": 50.0,
    "calls": 2_000_000,
    "ess": 400.0,
    "log_evidence": 6305.0,
    "log_evidence_sd": 0.4,
    "second": 0.0,
    "rhat": math.nan,
    "note": "",
}


@pytest.mark.parametrize(
    ("change", "right"),
    [
        ({}, True),
        ({"log_evidence": 6307.69}, False),
        ({"log_evidence": math.nan}, False),
        ({"second": 0.44}, False),
        ({"converged": False}, False),
    ],
)
def test_a_seed_is_right_only_if_everything_is(change: dict[str, float], right: bool) -> None:
    assert ours(**change).right is right
    assert evidence_row([ours(), ours(**change)]).holds is right


def test_ratios_are_theirs_over_ours() -> None:
    assert ultranest_row([ours()], PEER).value == pytest.approx(200.0)
    assert metropolis_row([ours()], PEER).value == pytest.approx((100 / 400) / (0.5 / 2000))


def test_routes_are_told_as_text() -> None:
    rows = route_rows([ours(), ours(cpu=0.6), ours(cpu=0.4)], {"emcee": {**PEER, "log_evidence": math.nan}})
    assert [row[0] for row in rows] == ["ours, median of 3 seeds", "emcee"]
    assert rows[0][1] == "0.50"
    assert rows[1][5] == "–"


def test_the_modes_are_told_apart_by_the_wheels_angle() -> None:
    turned = TRUTH.copy()
    turned[3] -= np.pi / 2
    assert second_share(np.array([TRUTH, turned, turned]), np.array([2.0, 1.0, 1.0])) == pytest.approx(0.5)


def test_a_peer_that_fails_is_one_line(tmp_path: Path) -> None:
    program = tmp_path / "python"
    program.write_text("#!/bin/sh\necho first >&2; echo 'no such sampler' >&2; exit 1\n", encoding="utf-8")
    program.chmod(0o755)
    with pytest.raises(BringupError, match="emcee failed and said: no such sampler"):
        inference.run_peer(program, "emcee", 0, 1.0, tmp_path)
