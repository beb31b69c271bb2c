"""XML that anybody may have written: no document types, no entities, no bottomless nesting."""

from __future__ import annotations

from typing import NoReturn
from xml.etree import ElementTree
from xml.parsers import expat

from pbrl_namo.errors import NamoError

MOST_BYTES = 20_000_000
"""Size of a file [B] that is read at all."""

DEEPEST = 60
"""Elements in elements that a drawing may have."""

MOST_ELEMENTS = 200_000
"""Elements of a drawing."""


def parse_xml(text: bytes, what: str) -> ElementTree.Element:
    """Return the root of an XML document.

    A document type is where entities are made that blow up to gigabytes or read other files, so none is taken. A first
    pass by the bare parser refuses it before anything of it is used, in whatever encoding it hides.

    Args:
        text: the file.
        what: it is, for messages.

    Raises:
        NamoError: it is no XML, too large, too deep, or has a document type.
    """
    if len(text) > MOST_BYTES:
        raise NamoError(f"{what}: expected at most {MOST_BYTES / 1e6:.0f} MB, got {len(text) / 1e6:.0f} MB")
    try:
        _inspect(text, what)
        return ElementTree.fromstring(text)
    except (expat.ExpatError, ElementTree.ParseError, ValueError, LookupError) as error:
        raise NamoError(f"{what}: expected well-formed XML, got {' '.join(str(error).split())}") from error


def _inspect(text: bytes, what: str) -> None:
    """Go through a document once and raise NamoError for what must not be in it."""
    depth = count = 0

    def refuse(*_: object) -> NoReturn:
        raise NamoError(f"{what}: expected no document type and no entities, got <!DOCTYPE or <!ENTITY; remove it")

    def enter(name: str, _: object) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > DEEPEST:
            raise NamoError(f"{what}: expected elements at most {DEEPEST} deep, got deeper ones at <{name[:40]}>")
        if count > MOST_ELEMENTS:
            raise NamoError(f"{what}: expected at most {MOST_ELEMENTS} elements, got more")

    def leave(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.StartElementHandler = enter
    parser.EndElementHandler = leave
    parser.Parse(text, True)
