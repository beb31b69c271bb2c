"""The house rules: imports run one way, and only files under `ros/` know rclpy."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
MODEL_SIDE = {"pbrl_bag", "pbrl_model"}
ALLOWED = {
    "pbrl_bag": {"pbrl_msgs"},
    "pbrl_model": {"pbrl_msgs", "pbrl_bag"},
    "pbrl_mismatch": {"pbrl_msgs", *MODEL_SIDE},
    "pbrl_control": {"pbrl_msgs", *MODEL_SIDE},
    "pbrl_planner": {"pbrl_msgs", *MODEL_SIDE, "pbrl_control"},
    "pbrl_namo": {"pbrl_msgs", *MODEL_SIDE, "pbrl_control", "pbrl_planner", "pbrl_mismatch"},
    "bullet_sim": {"pbrl_msgs"},
    "krang_sim": {"pbrl_msgs", "bullet_sim"},
    "pr2_cart_sim": {"pbrl_msgs", "bullet_sim"},
    "tabletop_sim": {"pbrl_msgs", "bullet_sim"},
}
ALLOWED["pbrl_bringup"] = {"pbrl_msgs", *ALLOWED}
FILES = sorted((ROOT / "src").glob("*/*/**/*.py"))


def imports(path: Path) -> Iterator[tuple[str, int]]:
    """Yield (module, line) for every import statement of a file, those inside functions too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or "", node.lineno


def module_name(path: Path) -> str:
    parts = path.relative_to(ROOT / "src").with_suffix("").parts[1:]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def package_of(path: Path) -> str:
    return path.relative_to(ROOT / "src").parts[0]


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_file_keeps_the_direction_of_imports(path: Path) -> None:
    package = package_of(path)
    for module, line in imports(path):
        other = module.split(".")[0]
        if other in ALLOWED or other == "pbrl_msgs":
            allowed = {*ALLOWED[package], package}
            assert other in allowed, f"{path}:{line}: {package} may import {sorted(allowed)}, imports {other}"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT / "src")))
def test_only_nodes_import_rclpy(path: Path) -> None:
    for module, line in imports(path):
        if module.split(".")[0] == "rclpy":
            assert "ros" in path.relative_to(ROOT / "src").parts, f"{path}:{line}: rclpy belongs under ros/"


ENDPOINTS = {
    "create_publisher",
    "create_subscription",
    "create_service",
    "create_client",
    "ActionClient",
    "ActionServer",
}
ENDPOINTS |= {"OneGoal", "Saying", "listen"}
GLOBAL = {"/clock", "/tf", "/tf_static"}  # absolute in every stack


@pytest.mark.parametrize(
    "path", sorted((ROOT / "src").glob("*/*/ros/*.py")), ids=lambda path: str(path.relative_to(ROOT / "src"))
)
def test_names_are_relative_so_that_two_robots_can_share_a_domain(path: Path) -> None:
    if path.name == "crash_harness.py" or package_of(path) == "pbrl_bringup":
        return  # speak to a graph of their own, or to one from outside
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call) or getattr(node.func, "attr", getattr(node.func, "id", "")) not in ENDPOINTS:
            continue
        for argument in node.args[:3]:
            first = argument.values[0] if isinstance(argument, ast.JoinedStr) else argument
            text = first.value if isinstance(first, ast.Constant) and isinstance(first.value, str) else ""
            assert not text.startswith("/") or text in GLOBAL, f"{path}:{node.lineno}: {text!r} is absolute"


def test_no_import_ring_inside_a_package() -> None:
    graph: dict[str, set[str]] = {}
    modules = {module_name(path) for path in FILES}
    for path in FILES:
        name = module_name(path)
        graph[name] = {module for module, _ in imports(path)} - {name}
        # `from package import module` is an edge to the module, not to the package's list of public names.
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                inside = {f"{node.module}.{alias.name}" for alias in node.names} & modules
                graph[name] |= inside
                if len(inside) == len(node.names):
                    graph[name].discard(node.module or "")
    done: set[str] = set()

    def visit(name: str, trail: tuple[str, ...]) -> None:
        assert name not in trail, f"import ring: {' -> '.join((*trail, name))}"
        if name not in done and name in graph:
            for other in graph[name]:
                visit(other, (*trail, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_every_package_is_known_and_filled() -> None:
    for folder in (ROOT / "src").iterdir():
        assert folder.name in ALLOWED, f"src/{folder.name} has no place in the order of packages"
        code = [path for path in folder.glob(f"{folder.name}/**/*.py") if path.name != "__init__.py"]
        assert len(code) >= 3, f"src/{folder.name} is an empty shell"


def test_every_file_parses_as_one_room() -> None:
    long = {str(path): count for path in FILES if (count := len(path.read_text().splitlines())) > 350}
    assert not long, f"past 350 lines, wants two files: {long}"
