"""On which kinds of baseline effects are tried: the simplest, the best, and richer ones that are nearly as good."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from pbrl_mismatch.search.explain import LED, WORTH_A_KIND, _grounds


def base(parameters: int, evidence: float) -> Any:
    return SimpleNamespace(hypothesis=SimpleNamespace(parameters=range(parameters)), evidence=evidence)


def test_where_a_locked_caster_is_the_best_a_wheel_is_tried_too() -> None:
    # What an effect did may have hidden the wheel's second axis, never that there is friction.
    caster, wheel, free = base(6, 0.0), base(8, -0.9 * LED), base(3, -900.0)
    assert _grounds([caster, wheel, free]) == [free, caster, wheel]
    far = base(8, -1.1 * LED)
    assert _grounds([caster, far, free]) == [free, caster]


@pytest.mark.parametrize(("worse", "count"), [(0.5 * WORTH_A_KIND, 1), (2.0 * WORTH_A_KIND, 2)])
def test_richer_kinds_are_tried_only_where_they_are_worth_it(worse: float, count: int) -> None:
    free, wheel = base(3, -worse), base(8, 0.0)
    assert len(_grounds([wheel, free])) == count
    assert _grounds([base(3, 0.0), base(8, -1.0)])[0].evidence == 0.0
    assert len(_grounds([base(3, 0.0), base(8, -1.0)])) == 1
