"""YAML that anybody may have written: a key written twice, or text no reader can take in, is an error in one line.

The learners' side reads YAML alike with code of its own; the simulators import nothing of it.
"""

from __future__ import annotations

from typing import Any

import yaml

MOST_LETTERS = 200_000
"""Of a document that is read at all: some seconds' work."""
MOST_VALUES = 100_000
"""Of a document, each counted as often as it stands there: a line of aliases can stand for a billion."""
LONGEST_NUMBER = 400
"""Digits of a number."""


def parse_yaml(text: str) -> Any:
    """Return what a YAML document says.

    Raises:
        ValueError: not YAML, a key that is there twice, lists in lists beyond all measure, aliases that stand for more
            than can be held, or a number too long to be one; one line.
    """
    if len(text) > MOST_LETTERS:
        raise ValueError(f"expected YAML of at most {MOST_LETTERS} letters, got {len(text)}")
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except RecursionError as error:
        raise ValueError("expected YAML, got lists or mappings nested too deep") from error
    except (yaml.YAMLError, TypeError, ValueError, LookupError, AttributeError, ArithmeticError) as error:
        told = " ".join(str(error).replace('in "<unicode string>", line', "at line").split())
        raise ValueError(f"expected YAML, got: {told[:400]}") from error


class _StrictLoader(yaml.SafeLoader):
    """Refuses a key that is there twice: YAML would let the second one win without a word."""

    def construct_document(self, node: yaml.Node) -> Any:
        """Refuse a document that is far larger than its text before anything of it is made."""
        _expanded(node, {})
        return super().construct_document(node)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Make a mapping."""
        if isinstance(node, yaml.MappingNode):
            seen: set[str] = set()
            for key_node, _ in node.value:
                key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
                if key in seen and key is not None:
                    told = f"key {key[:60]!r} is there twice"
                    raise yaml.constructor.ConstructorError(None, None, told, key_node.start_mark)
                seen |= {key} if key is not None else set()
        return super().construct_mapping(node, deep)

    def construct_number(self, node: yaml.ScalarNode) -> int:
        """Make a whole number."""
        if isinstance(node, yaml.ScalarNode) and len(node.value) > LONGEST_NUMBER:
            told = f"a number of {len(node.value)} digits"
            raise yaml.constructor.ConstructorError(None, None, told, node.start_mark)
        return int(self.construct_yaml_int(node))


_StrictLoader.add_constructor("tag:yaml.org,2002:int", _StrictLoader.construct_number)


def _expanded(node: yaml.Node, known: dict[int, int]) -> int:
    """Return how many values a node stands for.

    Raises:
        ConstructorError: they are too many, or it holds itself.
    """
    if isinstance(node, yaml.ScalarNode):
        return 1
    size = known.get(id(node))
    if size is None:
        known[id(node)] = -1  # until it is counted
        inside = node.value if isinstance(node, yaml.SequenceNode) else [each for pair in node.value for each in pair]
        size = known[id(node)] = 1 + sum(_expanded(each, known) for each in inside)
    if size < 0:
        raise yaml.constructor.ConstructorError(None, None, "an alias inside of what it stands for", node.start_mark)
    if size > MOST_VALUES:
        told = f"aliases that stand for more than {MOST_VALUES} values"
        raise yaml.constructor.ConstructorError(None, None, told, node.start_mark)
    return size
