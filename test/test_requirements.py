"""The three libraries that work without ROS say what they need, and what they say holds for what is pinned here."""

from __future__ import annotations

import ast
import re
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).resolve().parents[1]
LIBRARIES = ("pbrl_bag", "pbrl_model", "pbrl_mismatch")
BY_NAME = {"arviz", "h5netcdf"}
"""What is loaded by its name: ArviZ, which is slow to load, and what it writes netCDF with."""


def declared(package: str) -> dict[str, Requirement]:
    tree = ast.parse((ROOT / "src" / package / "setup.py").read_text(encoding="utf-8"))
    lists = [node.value for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg == "install_requires"]
    found = [Requirement(text) for text in ast.literal_eval(lists[0])]
    return {canonicalize_name(each.name): each for each in found}


def imported(package: str) -> set[str]:
    """Return the distributions whose modules a library imports, wherever in a file, its nodes left out."""
    owners, names = packages_distributions(), set()
    for path in (ROOT / "src" / package / package).rglob("*.py"):
        if "ros" in path.relative_to(ROOT / "src" / package).parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                names.add(node.module or package)
    roots = {name.split(".")[0] for name in names} - {package} - set(sys.stdlib_module_names)
    return {name if name in LIBRARIES else owners[name][0] for name in roots}


def pinned() -> dict[str, Version]:
    lines = (ROOT / "requirements" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    parts = [re.split("==", line) for line in lines if "==" in line and not line.startswith("#")]
    return {canonicalize_name(name): Version(version) for name, version in parts}


@pytest.mark.parametrize("package", LIBRARIES)
def test_what_a_library_imports_is_what_it_declares(package: str) -> None:
    needs = {canonicalize_name(each) for each in imported(package)}
    assert needs | (BY_NAME & set(declared(package))) == set(declared(package))


@pytest.mark.parametrize("package", LIBRARIES)
def test_bounds_let_in_what_is_pinned(package: str) -> None:
    known = pinned()
    for name, need in declared(package).items():
        if name.replace("-", "_") not in LIBRARIES:
            assert any(each.operator == ">=" for each in need.specifier), f"{package}: {name} has no lower bound"
            assert need.specifier.contains(known[name]), f"{package}: {need} does not let in {known[name]}"


@pytest.mark.parametrize("package", LIBRARIES)
def test_every_file_that_is_no_python_is_installed(package: str) -> None:
    tree = ast.parse((ROOT / "src" / package / "setup.py").read_text(encoding="utf-8"))
    data = next(node.value for node in ast.walk(tree) if isinstance(node, ast.keyword) and node.arg == "package_data")
    assert isinstance(data, ast.Dict)
    patterns = ast.literal_eval(data.values[0])
    folder = ROOT / "src" / package / package
    installed = {path for pattern in patterns for path in folder.glob(pattern)}
    others = {p for p in folder.rglob("*") if p.is_file() and p.suffix != ".py" and "__pycache__" not in p.parts}
    assert others == installed
    assert all((path / "__init__.py").exists() for path in {p.parent for p in folder.rglob("*.py")}), "find_packages"
