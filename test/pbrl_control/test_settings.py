"""Settings files: the installed one says what the defaults are, a hostile one is refused in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrl_control.errors import ControlError
from pbrl_control.settings import ControllerSettings, load_section, parse_section


def test_the_file_that_is_installed_holds_the_defaults(root: Path) -> None:
    path = root / "config/params/body_controller.yaml"
    assert load_section(path, ControllerSettings, "settings") == ControllerSettings()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("base: {sped: 0.3}", "base.sped: expected a known key, got 'sped'; did you mean 'speed'?"),
        ("qwertyuiop: 1", "known keys are"),
        ("base: {speed: -1}", "base.speed: Input should be greater than 0"),
        ("base: {speed: .nan}", "base.speed: Input should be"),
        ("base: {speed: .inf}", "base.speed: Input should be"),
        ("home: [0.7, 0.1]", "home.2"),
        ("compliance: {lateral: {damping: 0}}", "compliance.lateral.damping"),
        ("[1, 2]", "expected keys and values, got list"),
        ("", "expected keys and values, got NoneType"),
        ("a: [1", "got '<stream end>' at line 1"),
    ],
)
def test_a_hostile_file_is_refused_in_one_line(text: str, complaint: str) -> None:
    with pytest.raises(ControlError) as caught:
        parse_section(text, ControllerSettings, "settings x.yaml")
    assert complaint in str(caught.value)
    assert str(caught.value).startswith("settings x.yaml: ")
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ControlError, match="expected a readable YAML file"):
        load_section(tmp_path / "none.yaml", ControllerSettings, "settings")
