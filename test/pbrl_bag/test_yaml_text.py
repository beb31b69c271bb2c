"""YAML that a person wrote: what any reader of it refuses, in one line."""

from __future__ import annotations

import pytest

from bullet_sim.yaml_text import parse_yaml as simulators_parse_yaml
from pbrl_bag.yaml_text import MOST_LETTERS, parse_yaml


def test_what_is_well_written_is_read() -> None:
    assert parse_yaml("a: [1, 2.5, x]\nb: {c: null}\n") == {"a": [1, 2.5, "x"], "b": {"c": None}}
    assert parse_yaml("") is None


def test_a_merge_key_is_no_repetition() -> None:
    assert parse_yaml("base: &b {x: 1}\none: {<<: *b, y: 2}\n")["one"] == {"x": 1, "y": 2}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a: 1\nb: 2\na: 3\n", ("'a'", "twice", "line 3")),
        ("outer:\n  inner: 1\n  inner: 2\n", ("'inner'", "twice", "line 3")),
        ("a:\n\tb: 1\n", ("line 2",)),
        ("[" * 3000 + "]" * 3000, ("nested too deep",)),
        ("a: " + "9" * 5000, ("digits",)),
        ("a: [1, 2", ("line 1",)),
        ("a: !!python/object/apply:os.system [ls]", ("constructor",)),
        ("? [a, b]\n: 1\n", ("unhashable",)),
        ("a: !!timestamp x", ("groupdict",)),
        ("a: !!bool x", ("'x'",)),
        ("a: !!int ''", ("index",)),
        ("<<: 1", ("merging",)),
        ("a: &a [*a]", ("alias",)),
        ("a0: &a0 [x, x]\n" + "\n".join(f"a{k}: &a{k} [{f'*a{k - 1}, ' * 9}]" for k in range(1, 9)), ("aliases",)),
        (
            "m0: &m0 {x: 1}\n" + "\n".join(f"m{k}: &m{k} {{<<: [{f'*m{k - 1}, ' * 2}]}}" for k in range(1, 30)),
            ("aliases",),
        ),
        ("a: 0x" + "f" * 5000, ("digits",)),
        ("a: 1" + ":59" * 5000, ("digits",)),
    ],
    ids=[
        *("twice", "twice inside", "tab", "deep", "long number", "cut off", "python", "list as key"),
        *(
            "no time",
            "no truth value",
            "no number",
            "merges a number",
            "holds itself",
            "billion laughs",
            "merges",
            "hexadecimal",
        ),
        "sexagesimal",
    ],
)
def test_what_is_not_is_one_line(text: str, words: tuple[str, ...]) -> None:
    for parse in (parse_yaml, simulators_parse_yaml):
        with pytest.raises(ValueError, match="expected YAML, got") as caught:
            parse(text)
        assert "\n" not in str(caught.value)
        for word in words:
            assert word in str(caught.value)


def test_a_document_beyond_all_measure_is_not_begun() -> None:
    with pytest.raises(ValueError, match=f"at most {MOST_LETTERS} letters"):
        parse_yaml("- " * MOST_LETTERS)
