"""What URDF and SDF have in common: numbers, comments, vectors, and the text of a tree."""

from __future__ import annotations

import re
from collections.abc import Iterable
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement


def number(value: float) -> str:
    """Return a number with as many digits as matter."""
    return f"{value:.9g}"


def vector(values: Iterable[float]) -> str:
    """Return numbers with spaces between them."""
    return " ".join(number(value) for value in values)


def add(parent: Element, tag: str, text: str | float | None = None, **attributes: str | float) -> Element:
    """Add an element; numbers become text."""
    told = {key: number(value) if isinstance(value, float) else value for key, value in attributes.items()}
    element = SubElement(parent, tag, told)
    if text is not None:
        element.text = number(text) if isinstance(text, float) else text
    return element


def comment(parent: Element, lines: Iterable[str]) -> None:
    """Add a comment; XML has no two dashes in one, and no dash at its end."""
    text = "\n".join(re.sub(r"-(?=-)", "- ", line).rstrip("-") for line in lines)
    parent.append(ElementTree.Comment(f"\n{text}\n"))


def xml_name(name: str) -> str:
    """Return a name that links and models may have: letters, digits and underscores."""
    return re.sub(r"\W", "_", name, flags=re.ASCII)


def text_of(root: Element) -> str:
    """Return the whole file."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
