"""Every parameter of every node is described, typed and bounded, refused where it is wrong, and in the node's file."""

from __future__ import annotations

import importlib
import signal
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest
from node_parameters import FOLDER, Executable, Parameter, declared, executables, text_of
from rcl_interfaces.msg import ParameterType

from pbrl_bringup.graph import free_domain

NODES = executables()
KINDS = {
    bool: ParameterType.PARAMETER_BOOL,
    int: ParameterType.PARAMETER_INTEGER,
    float: ParameterType.PARAMETER_DOUBLE,
    str: ParameterType.PARAMETER_STRING,
    list: ParameterType.PARAMETER_STRING_ARRAY,
}
NUMBERS = (ParameterType.PARAMETER_INTEGER, ParameterType.PARAMETER_DOUBLE)


@pytest.fixture(autouse=True)
def domain(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    handlers = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.chdir(tmp_path)
    with free_domain() as number:
        monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
        yield
    for each, handler in handlers.items():
        signal.signal(each, handler)


@cache
def parameters_of(node: Executable) -> list[Parameter]:
    return declared(node.module)


def test_there_are_nodes() -> None:
    assert len(NODES) >= 17


@pytest.mark.parametrize("node", NODES, ids=str)
def test_every_parameter_is_described_typed_and_bounded(node: Executable) -> None:
    parameters = parameters_of(node)
    assert parameters, f"{node} declares nothing"
    for each in parameters:
        about = each.descriptor
        kind = type(each.value) if type(each.value) in KINDS else list
        assert about.type == KINDS[kind], f"{each.name}: type"
        assert about.read_only, f"{each.name}: is read at the start only"
        assert len(about.description) > len("a phrase"), f"{each.name}: expected a phrase, got {about.description!r}"
        if about.type in NUMBERS:
            assert each.bounds is not None, f"{each.name}: expected a range"
            least, greatest = each.bounds
            assert least <= each.value <= greatest
            assert about.additional_constraints == f"{least:.10g} to {greatest:.10g}"


@pytest.mark.parametrize("node", NODES, ids=str)
def test_the_file_of_a_node_says_what_it_declares(node: Executable) -> None:
    assert node.file.is_file(), "write it: python test/system/node_parameters.py"
    expected = text_of(node, parameters_of(node))
    assert node.file.read_text(encoding="utf-8") == expected, "write it anew: python test/system/node_parameters.py"


def test_no_file_is_of_a_node_that_is_gone() -> None:
    assert set(FOLDER.glob("*/*.yaml")) == {node.file for node in NODES}


@pytest.mark.parametrize("node", NODES, ids=str)
def test_a_node_takes_its_file_as_it_is(node: Executable) -> None:
    taken = declared(node.module, ["--params-file", str(node.file)])
    assert taken == parameters_of(node)


def wrong_values() -> Iterator[tuple[Executable, str, str, str]]:
    """Every bounded number beyond both of its bounds, and every choice misspelt."""
    with free_domain() as number, pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_DOMAIN_ID", str(number))
        for node in NODES:
            for each in parameters_of(node):
                listed = each.descriptor.additional_constraints
                if each.bounds is not None:
                    least, greatest = each.bounds
                    step = 1 if isinstance(each.value, int) else 0.5 * (greatest - least)
                    yield node, each.name, repr(greatest + step), listed
                    yield node, each.name, repr(least - step), listed
                elif listed and isinstance(each.value, str):
                    yield node, each.name, listed.split(",")[0].split(" or ")[0] + "x", listed


def test_a_value_beyond_a_bound_ends_the_node_with_code_2_and_the_bound(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    tried = 0
    for node, name, value, listed in wrong_values():
        monkeypatch.setattr(sys, "argv", [node.name, "--ros-args", "-p", f"{name}:={value}"])
        with pytest.raises(SystemExit) as ended:
            importlib.import_module(node.module).main()
        (line,) = capfd.readouterr().err.strip().splitlines()
        assert ended.value.code == 2, line
        assert line.startswith(f"{node.name}: {name}: expected {listed}"), line
        assert line.endswith(f"got {_shown(value)}") or f"got {value!r}; did you mean" in line, line
        tried += 1
    assert tried > 50


def _shown(value: str) -> str:
    return value if value.isalpha() else f"{float(value):.10g}"
