"""A compiled leaf borrows arrays, and calls only what does not make any either; threads that wait leave their core."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import njit
from numba.core.errors import TypingError

from pbrl_bag.kernel_options import LEAF

SOURCES = sorted((Path(__file__).resolve().parents[2] / "src").glob("*/*/**/*.py"))
KERNELS = [path for path in SOURCES if "njit" in path.read_text(encoding="utf-8")]


def compiled(path: Path) -> dict[ast.FunctionDef, bool]:
    """Return the compiled functions of a file, and whether each is a leaf; inlined ones are part of their callers."""
    found = {}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef):
            for call in node.decorator_list:
                text = ast.unparse(call)
                if text.startswith("njit(") and "inline='always'" not in text:
                    found[node] = "LEAF" in text
    return found


OTHERS = {node.name for path in KERNELS for node, leaf in compiled(path).items() if not leaf}
LEAVES = {node.name for path in KERNELS for node, leaf in compiled(path).items() if leaf}


@pytest.mark.parametrize("path", KERNELS, ids=lambda path: path.name)
def test_leaves_return_numbers_and_call_leaves(path: Path) -> None:
    for node, leaf in compiled(path).items():
        if leaf:
            told = ast.unparse(node.returns) if node.returns else "nothing"
            assert not {"Array", "Index", "Mask", "NDArray", "nothing"} & set(told.replace("[", " ").split()), node.name
            calls = {c.func.id for c in ast.walk(node) if isinstance(c, ast.Call) and isinstance(c.func, ast.Name)}
            assert not calls & (OTHERS - LEAVES), f"{path.name}: {node.name} is a leaf, and calls one that is none"


def test_a_leaf_that_makes_an_array_does_not_compile() -> None:
    @njit(**{**LEAF, "cache": False})
    def made(count: int) -> float:
        return float(np.ones(count).sum())

    with pytest.raises(TypingError, match="No implementation of function"):
        made(3)


ON_ALL_CORES = """
from pbrl_bag import kernel_options
from numba import njit, prange

@njit(parallel=True)
def count(most):
    found = 0
    for _ in prange(most):
        found += 1
    return found

assert count(100) == 100
"""


@pytest.mark.parametrize(("told", "heard"), [({}, "PASSIVE"), ({"OMP_WAIT_POLICY": "active"}, "ACTIVE")])
def test_threads_that_wait_leave_their_core_unless_told_otherwise(told: dict[str, str], heard: str) -> None:
    clean = {name: value for name, value in os.environ.items() if name != "OMP_WAIT_POLICY"}
    shown = {"NUMBA_THREADING_LAYER": "omp", "OMP_DISPLAY_ENV": "true", **told}
    done = subprocess.run([sys.executable, "-c", ON_ALL_CORES], env=clean | shown, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert f"OMP_WAIT_POLICY = '{heard}'" in done.stderr


@pytest.mark.parametrize(
    "path", [path for path in KERNELS if "prange" in path.read_text(encoding="utf-8")], ids=lambda path: path.name
)
def test_whoever_loops_on_all_cores_has_said_how_threads_wait(path: Path) -> None:
    told = [node.module for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if hasattr(node, "module")]
    assert "pbrl_bag.kernel_options" in told
