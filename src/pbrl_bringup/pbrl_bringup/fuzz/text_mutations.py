"""Mutations of XML and of tables."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np

from pbrl_bringup.fuzz.byte_mutations import mutate_bytes, mutate_text, written
from pbrl_bringup.fuzz.hostile import NUMBERS, TEXTS, XML_BOMBS


def mutate_xml(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """Return an XML document with something done to its elements, or to its bytes."""
    draw = rng.random()
    if draw < 0.3:
        return (mutate_bytes if draw < 0.05 else mutate_text)(data, rng, others)
    if draw < 0.35:
        return XML_BOMBS[rng.integers(len(XML_BOMBS))].encode()
    root = ElementTree.fromstring(data)  # of our own corpus
    for _ in range(1 + int(rng.geometric(0.4))):
        _mutate_element(root, rng)
    return ElementTree.tostring(root)


def _mutate_element(root: ElementTree.Element, rng: np.random.Generator) -> None:
    elements = list(root.iter())
    element = elements[rng.integers(len(elements))]
    kind = rng.integers(7)
    keys = list(element.attrib)
    if kind <= 2 and keys:
        key = keys[rng.integers(len(keys))]
        words = element.attrib[key].replace(",", " ").split()
        value = _word(rng)
        if words and rng.random() < 0.7:
            words[rng.integers(len(words))] = value
            value = " ".join(words)
        element.set(key, value)
    elif kind == 3 and keys:
        del element.attrib[keys[rng.integers(len(keys))]]
    elif kind == 4:
        element.append(elements[rng.integers(len(elements))]) if element is not root else None
    elif kind == 5 and len(element):
        element.remove(element[int(rng.integers(len(element)))])
    elif kind == 6:
        element.tag = str(rng.choice(["g", "path", "use", "image", "script", "svg", "rect", "link", "joint", "mesh"]))
    if _is_ring(root):
        for child in list(element):
            element.remove(child)


def _is_ring(root: ElementTree.Element) -> bool:
    """Tell whether an element was put into itself, or there are far too many."""
    stack, seen = [(root, 0)], 0
    while stack:
        element, depth = stack.pop()
        seen += 1
        if depth > 200 or seen > 20_000:
            return True
        stack += [(child, depth + 1) for child in element]
    return False


def _word(rng: np.random.Generator) -> str:
    if rng.random() < 0.5:
        return written(NUMBERS[rng.integers(len(NUMBERS))])
    text = TEXTS[rng.integers(len(TEXTS))]
    return "".join(letter for letter in text if letter >= " " and not "\ud800" <= letter <= "\udfff")


def mutate_table(data: bytes, rng: np.random.Generator, others: Sequence[bytes]) -> bytes:
    """Return a CSV table with something done to its cells, rows and columns, or to its bytes."""
    if (draw := rng.random()) < 0.3:
        return (mutate_bytes if draw < 0.05 else mutate_text)(data, rng, others)
    rows = list(csv.reader(io.StringIO(data.decode())))
    for _ in range(1 + int(rng.geometric(0.4))):
        row = rows[rng.integers(len(rows))]
        kind = rng.integers(6)
        if kind <= 1 and row:
            row[rng.integers(len(row))] = _word(rng)
        elif kind == 2 and row:
            del row[rng.integers(len(row))]
        elif kind == 3:
            rows.insert(int(rng.integers(len(rows))), list(row))
        elif kind == 4 and len(rows) > 1:
            rows.remove(row)
        elif kind == 5:
            rows[0], row[:] = list(rows[rng.integers(len(rows))]), list(rows[0])
    file = io.StringIO()
    csv.writer(file, delimiter=str(rng.choice([",", ",", ",", ";", "\t"]))).writerows(rows)
    return file.getvalue().encode("utf-8", "replace")
