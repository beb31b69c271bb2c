"""YAML that a person wrote: a key written twice, or text no reader can take in, is an error in one line."""

from __future__ import annotations

from typing import Any

import yaml


def parse_yaml(text: str) -> Any:
    """Return what a YAML document says.

    Raises:
        ValueError: not YAML, a key that is there twice, lists in lists beyond all measure, or a number too
            long to be one; one line.
    """
    try:
        return yaml.load(text, Loader=_StrictLoader)
    except RecursionError as error:
        raise ValueError("expected YAML, got lists or mappings nested too deep") from error
    except (yaml.YAMLError, TypeError, ValueError) as error:
        told = " ".join(str(error).replace('in "<unicode string>", line', "at line").split())
        raise ValueError(f"expected YAML, got: {told}") from error


class _StrictLoader(yaml.SafeLoader):
    """Refuses a key that is there twice: YAML would let the second one win without a word."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[str] = set()
        for key_node, _ in node.value:
            key = key_node.value if isinstance(key_node, yaml.ScalarNode) else None
            if key in seen and key is not None:
                raise yaml.constructor.ConstructorError(None, None, f"key {key!r} is there twice", key_node.start_mark)
            seen |= {key} if key is not None else set()
        return super().construct_mapping(node, deep)
