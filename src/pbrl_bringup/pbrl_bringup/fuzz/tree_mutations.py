"""Mutations of what YAML and JSON say: keys dropped, doubled, renamed, values of another kind, deep nesting."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import yaml

from pbrl_bringup.fuzz.byte_mutations import mutate_bytes, mutate_text, written
from pbrl_bringup.fuzz.hostile import JSON_BOMBS, NOTHINGS, NUMBERS, TEXTS, YAML_BOMBS

DEEP, LONG = 60, 3000
LARGEST = 50_000
"""Nodes of a tree that is still mutated, or written: what is many times longer is what byte mutations are for."""


def mutate_yaml(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """Return a YAML document with something done to it: mostly to what it says, else to its bytes."""
    return _mutate(data, rng, others, yaml_of, _yaml_text, YAML_BOMBS)


def mutate_json(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """Return a JSON document with something done to it, likewise."""
    return _mutate(data, rng, others, json.loads, _json_text, JSON_BOMBS)


def yaml_of(data: bytes) -> Any:
    """Return what a document of the corpus says, read as fast as can be."""
    return yaml.load(data, getattr(yaml, "CSafeLoader", yaml.SafeLoader))


def _mutate(
    data: bytes,
    rng: np.random.Generator,
    others: Sequence[bytes],
    parse: Callable[[bytes], Any],
    text: Callable[[Any], str],
    bombs: Sequence[str],
) -> bytes:
    draw = rng.random()
    if draw < 0.25:
        return (mutate_bytes if draw < 0.05 else mutate_text)(data, rng, others)
    if draw < 0.30:
        bomb = bombs[int(rng.integers(len(bombs)))].encode("utf-8", "surrogatepass")
        return bomb if rng.random() < 0.5 else data + b"\n" + bomb
    tree = parse(data)
    for _ in range(1 + int(rng.geometric(0.5))):
        mutated = mutate_tree(tree, rng)
        if _is_large(mutated):
            break
        tree = mutated
    return text(tree).encode("utf-8", "replace")


def _is_large(tree: Any) -> bool:
    """Tell whether plain data has more than `LARGEST` nodes, without counting on."""
    waiting, count = [tree], 0
    while waiting:
        node = waiting.pop()
        count += 1
        if isinstance(node, dict | list):
            waiting.extend(node.values() if isinstance(node, dict) else node)
        if count + len(waiting) > LARGEST:
            return True
    return False


def mutate_tree(tree: Any, rng: np.random.Generator) -> Any:
    """Return plain data with one thing done to one of its nodes."""
    root = {"root": copy.deepcopy(tree)}
    holder, key = _node(root, rng)
    kind = rng.integers(10)
    value = holder[key]
    if kind <= 3:
        holder[key] = _hostile(value, rng)
    elif kind == 4 and holder is not root:
        del holder[key]
    elif kind == 5 and isinstance(holder, dict) and holder is not root:
        text = TEXTS[rng.integers(len(TEXTS))]
        holder[text if rng.random() < 0.7 else NUMBERS[rng.integers(len(NUMBERS))]] = holder.pop(key)
    elif kind == 6:
        others, other = _node(root, rng)
        holder[key] = copy.deepcopy(others[other])
    elif kind == 7:
        holder[key] = _deep(value, int(rng.choice([1, 2, DEEP])))
    elif kind == 8 and isinstance(value, list):
        holder[key] = value * int(rng.choice([0, 2, max(1, LONG // max(len(value), 1))]))
    elif kind == 9 and isinstance(value, list) and value:
        holder[key] = value[: int(rng.integers(len(value)))]
    else:
        holder[key] = _hostile(value, rng)
    return root["root"]


def _node(root: dict[str, Any], rng: np.random.Generator) -> tuple[Any, Any]:
    """Return a node as what holds it and its key there; each level is as likely as the next."""
    holder: Any = root
    key: Any = "root"
    while isinstance(holder[key], dict | list) and holder[key] and rng.random() < (0.97 if holder is root else 0.85):
        holder = holder[key]
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        key = keys[int(rng.integers(len(keys)))]
    return holder, key


def _hostile(value: Any, rng: np.random.Generator) -> Any:
    """Return a value in the place of another: mostly of its own kind, so that it is looked at at all."""
    draw = rng.random()
    if isinstance(value, bool) or draw < 0.15:
        return copy.deepcopy(NOTHINGS[rng.integers(len(NOTHINGS))])
    if (isinstance(value, int | float) and draw < 0.85) or draw < 0.3:
        return NUMBERS[rng.integers(len(NUMBERS))]
    if isinstance(value, str) and draw < 0.5:
        return value + TEXTS[rng.integers(len(TEXTS))]
    return TEXTS[rng.integers(len(TEXTS))]


def _deep(value: Any, levels: int) -> Any:
    for _ in range(levels):
        value = [value]
    return value


class _Dumper(getattr(yaml, "CSafeDumper", yaml.SafeDumper)):  # type: ignore[misc]
    """Writes what is there twice twice."""

    def ignore_aliases(self, _: Any) -> bool:
        return True


def _huge(dumper: Any, value: int) -> Any:
    """Write an integer, however many digits it takes."""
    return dumper.represent_scalar("tag:yaml.org,2002:int", written(value))


_Dumper.add_representer(int, _huge)


def _yaml_text(tree: Any) -> str:
    return str(yaml.dump(tree, Dumper=_Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True))


def _json_text(tree: Any) -> str:
    return json.dumps(_writable(tree))


def _writable(tree: Any) -> Any:
    """Return plain data with keys that are texts, and without numbers of more digits than Python writes."""
    if isinstance(tree, dict):
        return {str(key) if isinstance(key, str | float) else "": _writable(each) for key, each in tree.items()}
    if isinstance(tree, list):
        return [_writable(each) for each in tree]
    return float("inf") if isinstance(tree, int) and abs(tree) > 10**300 else tree
