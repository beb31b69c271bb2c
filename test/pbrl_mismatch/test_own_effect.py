"""A law of one's own: the kernel does with it what it does with the library's, and what is no law is refused."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from kernel_bench import Bench
from pushed_table import MASS

from pbrl_mismatch import EFFECTS, DiagnoseOptions, MismatchError, OwnEffect, Prior, Scene, register_effect
from pbrl_mismatch.effects.own import NOMINAL, Law, forget_effect, own_effects
from pbrl_mismatch.effects.own_file import load_effects
from pbrl_mismatch.kernels.columns import COLUMN, COLUMNS, SPARE, UNIT, WIDTH, neutral_row
from pbrl_mismatch.observability.strengths import strength_columns
from pbrl_mismatch.repaired import load_repaired, rows_of
from pbrl_model.model_file import LearnedEffect, SavedModel, Shape, learned, save_model

Triple = tuple[float, float, float]
PUSH = np.column_stack([8.0 * np.sin(0.03 * np.arange(300)), np.full(300, 2.0), np.full(300, 0.4)])


def spring_and_drag(time: float, pose: Triple, twist: Triple, parameters: tuple[float, ...]) -> Triple:
    drag, turn, stiff, x, y = parameters
    return (
        -drag * twist[0] - stiff * (pose[0] - x),
        -drag * twist[1] - stiff * (pose[1] - y),
        -turn * twist[2],
    )


UNITS = {"drag": "N s/m", "turn": "N m s", "stiff": "N/m", "x": "m", "y": "m"}


def priors(scene: Scene) -> dict[str, Prior]:
    return {
        "drag": Prior(10.0, 1.0, positive=True),
        "turn": Prior(1.0, 1.0, positive=True),
        "stiff": Prior(20.0, 1.0, positive=True),
        "x": Prior(float(scene.middle[0]), float(scene.reach[0])),
        "y": Prior(float(scene.middle[1]), float(scene.reach[1])),
    }


def made(law: Law = spring_and_drag, **changed: object) -> OwnEffect:
    told: dict[str, object] = {
        "name": "own_spring",
        "summary": "A spring and a damper.",
        "law": law,
        "units": UNITS,
        "priors": priors,
        "strength": ("drag", "turn", "stiff"),
        "place": ("x", "y"),
    }
    return OwnEffect(**{**told, **changed})  # type: ignore[arg-type]


@pytest.fixture
def spring() -> Iterator[None]:
    register_effect(made())
    yield
    forget_effect("own_spring")
    assert own_effects() == ()


def test_the_kernel_does_with_a_law_what_it_does_with_the_library_s(bench: type[Bench], spring: None) -> None:
    start = np.array([0.3, -0.2, 0.4, 0.1, 0.05, -0.1])
    own = bench(PUSH, start).run(own_spring_on=1.0, own_spring_drag=12.0, own_spring_turn=2.0)
    np.testing.assert_allclose(own, bench(PUSH, start).run(drag_linear=12.0, drag_turn=2.0), atol=1e-9)
    assert np.abs(own - bench(PUSH, start).run()).max() > 0.1


def test_a_spring_swings_as_a_spring_does(bench: type[Bench], spring: None) -> None:
    start = np.array([0.5, -0.2, 0.4, 0.0, 0.0, 0.0])
    own = bench(np.zeros((600, 3)), start).run(own_spring_on=1.0, own_spring_stiff=30.0, own_spring_x=0.1)
    swing = np.cos(math.sqrt(30.0 / MASS) * 0.01 * np.arange(601))
    np.testing.assert_allclose(own[:, 0], 0.1 + 0.4 * swing, atol=5e-3)
    np.testing.assert_allclose(own[:, 1], -0.2 * swing, atol=5e-3)
    np.testing.assert_allclose(own[:, 2], 0.4, atol=1e-9)


def test_a_law_that_is_off_or_forgotten_changes_nothing(bench: type[Bench]) -> None:
    before = bench(PUSH).run()
    register_effect(made())
    assert np.array_equal(bench(PUSH).run(own_spring_stiff=100.0), before)
    on = neutral_row()
    on[COLUMN["own_spring_on"]], on[COLUMN["own_spring_stiff"]] = 1.0, 100.0
    column = COLUMN["own_spring_on"]
    forget_effect("own_spring")
    assert np.array_equal(bench(PUSH).run(), before) and COLUMNS[column] == f"spare_{column - WIDTH + SPARE}"
    assert len(on) == WIDTH == len(set(COLUMNS)) == len(UNIT)


def test_very_stiff_drag_is_steady(bench: type[Bench], spring: None) -> None:
    path = bench(PUSH).run(own_spring_on=1.0, own_spring_drag=1e6, own_spring_turn=1e6)
    assert np.isfinite(path).all() and np.abs(path).max() < 1e-3


def test_a_torque_is_about_the_frame_s_origin_and_twists_are_of_it(bench: type[Bench]) -> None:
    def at_origin(time: float, pose: Triple, twist: Triple, parameters: tuple[float, ...]) -> Triple:
        return parameters[0], 0.0, 0.0

    register_effect(made(at_origin, units={"force": "N"}, priors=lambda s: {"force": Prior(1.0, 1.0)},
                         strength=("force",), place=None))  # fmt: skip
    try:
        rest = np.zeros((100, 3))
        found = bench(rest).run(own_spring_on=1.0, own_spring_force=4.0, com_y=0.2)
        # A force through the frame's origin turns a body whose mass is centred to the left of it.
        known = bench(np.tile([4.0, 0.0, 0.0], (100, 1))).run(com_y=0.2)
        assert found[-1, 2] > 0.01
        np.testing.assert_allclose(found, known, atol=2e-3)
    finally:
        forget_effect("own_spring")


def test_it_is_in_the_library_like_every_other(spring: None) -> None:
    assert list(EFFECTS)[-1] == "own_spring" and "own_spring" in DiagnoseOptions().effects
    assert "own_spring" not in DiagnoseOptions(without=("own_spring",)).effects
    effect = EFFECTS["own_spring"]
    chosen = effect.chosen(NOMINAL, 0)
    assert [each.column for each in chosen] == [f"own_spring_{name}" for name in UNITS]
    assert [each.unit for each in chosen] == list(UNITS.values())
    assert strength_columns("own_spring", effect.variants[0]) == tuple(effect.linear)
    assert effect.where is not None
    where = effect.where({"own_spring_x": 1.0, "own_spring_y": 2.0}, NOMINAL)
    assert where is not None and np.allclose(where.shape.mean(axis=0), [1.0, 2.0])


def test_a_model_s_file_is_simulated_where_the_law_is_known(tmp_path: Path) -> None:
    register_effect(made())
    told = {f"own_spring_{name}": learned(unit, np.array([2.0, 4.0]), 3.0) for name, unit in UNITS.items()}
    model = SavedModel(
        object="table",
        shape=Shape(footprint=((0, 0), (1, 0), (1, 1)), feet=((0, 0),), com=(0.6, 0.3), inertia_per_mass=0.1),
        parameters={"mass": learned("kg", np.array([19.0, 21.0]), 20.0)},
        effects=(LearnedEffect(effect="own_spring", parameters=told, fixed={"own_spring_on": 1.0}),),
    )
    save_model(model, tmp_path / "model_table.json")
    (row,) = rows_of(load_repaired(tmp_path / "model_table.json"))
    assert row[COLUMN["own_spring_on"]] == 1.0 and row[COLUMN["own_spring_x"]] == 3.0
    forget_effect("own_spring")
    with pytest.raises(MismatchError, match="own_spring"):
        load_repaired(tmp_path / "model_table.json")


def test_a_cell_may_be_run_again_with_other_parameters() -> None:
    for _ in range(3):
        register_effect(made())
    register_effect(made(lambda t, q, v, p: (p[0], 0.0, 0.0), units={"force": "N"}, strength=("force",), place=None,
                         priors=lambda s: {"force": Prior(0.0, 2.0)}))  # fmt: skip
    assert own_effects() == ("own_spring",) and "own_spring_drag" not in COLUMN and "own_spring_force" in COLUMN
    forget_effect("own_spring")


def no_tuple(time: float, pose: Triple, twist: Triple, parameters: tuple[float, ...]) -> Triple:
    return "push"  # type: ignore[return-value]


def first(time: float, pose: Triple, twist: Triple, parameters: tuple[float, ...]) -> Triple:
    return parameters[0], 0.0, 0.0


def squared(time: float, pose: Triple, twist: Triple, parameters: tuple[float, ...]) -> Triple:
    return parameters[0] ** 2, 0.0, 0.0


def broken(time: float, pose: Triple, twist: Triple, parameters: tuple[float, ...]) -> Triple:
    return parameters[0] * math.nan, 0.0, 0.0


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"name": "tether"}, "does not have yet"),
        ({"name": "Fan!"}, "names such as fan"),
        ({"strength": ()}, "expected a strength"),
        ({"strength": ("stif",)}, "stiff"),
        ({"place": ("x", "z")}, "expected one of"),
        ({"priors": lambda scene: {"drag": Prior(1.0, 1.0)}}, "expected priors of"),
        ({"priors": lambda scene: {**priors(scene), "x": Prior(0.0, 0.0)}}, "spread above zero"),
        ({"law": no_tuple}, "numba can compile"),
        ({"law": squared}, "proportional"),
        ({"law": broken}, "finite wrench"),
        ({"units": {**UNITS, **dict.fromkeys((f"p{k}" for k in range(SPARE)), "N")}, "law": first}, "at most"),
    ],
)
def test_what_is_no_effect_is_refused_and_leaves_nothing_behind(changed: Mapping[str, object], said: str) -> None:
    with pytest.raises(MismatchError, match=said):
        register_effect(made(**changed))  # type: ignore[arg-type]
    assert own_effects() == () and all(name.startswith("spare_") for name in COLUMNS[-SPARE:])


def test_a_file_adds_effects_or_says_why_not(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "from pbrl_mismatch import OwnEffect, Prior, register_effect\n"
        "def law(time, pose, twist, parameters):\n    return parameters[0], 0.0, 0.0\n"
        "register_effect(OwnEffect(name='mine', summary='A push.', law=law, units={'force': 'N'},\n"
        "    priors=lambda scene: {'force': Prior(0.0, 0.4 * scene.force)}, strength=('force',)))\n"
    )
    assert load_effects(file) == ("mine",) == load_effects(file)
    forget_effect("mine")
    for text, said in (
        ("1 / 0", "ZeroDivisionError"),
        ("x = 1", "adds no effect"),
        ("import sys; sys.exit(3)", "Exit"),
    ):
        file.write_text(text)
        with pytest.raises(MismatchError, match=said):
            load_effects(file)
    with pytest.raises(MismatchError, match="no file"):
        load_effects(tmp_path / "none.py")


def test_only_what_was_added_can_be_forgotten() -> None:
    for name in ("tether", "own_spring"):
        with pytest.raises(MismatchError, match="that was added"):
            forget_effect(name)
