"""`ros2msg` schemas: the text of a message type with the text of every type it is made of.

The texts come from the .msg files that each package installs below a prefix of AMENT_PREFIX_PATH,
so a bag describes itself to readers that know none of the packages.
"""

from __future__ import annotations

import functools
import json
import os
import re
from dataclasses import dataclass
from pathlib import Path

from pbrl_bag.errors import BagError

SEPARATOR = "=" * 80
PRIMITIVES = frozenset(
    {"bool", "byte", "char", "string", "wstring", "float32", "float64"}
    | {f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)}
)
_TYPE_NAME = re.compile(r"(?P<package>[a-z][a-z0-9_]*)/msg/(?P<name>[A-Z][A-Za-z0-9]*)")
_FIELD = re.compile(
    r"^\s*(?P<type>[A-Za-z][A-Za-z0-9_/]*)(<=\d+)?(?P<array>\[(?P<bound><=)?(?P<length>\d*)\])?\s+(?P<name>[a-z]\w*)\b(?!\s*=)"
)


@dataclass(frozen=True)
class Field:
    """One field of a message type.

    Attributes:
        name: of the field.
        type: a primitive, or package/msg/Name.
        array: it holds several.
        length: how many, for an array of fixed length; else None.
    """

    name: str
    type: str
    array: bool
    length: int | None


@functools.cache
def message_definition(type_name: str) -> str:
    """Return the schema text of a message type, dependencies after `===` separators.

    Args:
        type_name: as on the wire, "geometry_msgs/msg/PoseStamped".

    Raises:
        BagError: the name is no message type, or its .msg file is not installed.
    """
    parts = [message_text(type_name)]
    for other in dependencies(type_name):
        package, _, name = other.split("/")
        parts.append(f"{SEPARATOR}\nMSG: {package}/{name}\n{message_text(other)}")
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"


def dependencies(type_name: str) -> tuple[str, ...]:
    """Return every type that a type is made of, each once, in the order of their first use.

    Raises:
        BagError: one of them is not installed.
    """
    found: dict[str, None] = {}
    waiting = [type_name]
    while waiting:
        current = waiting.pop(0)
        for other in (field.type for field in fields_of(current)):
            if other not in PRIMITIVES and other not in found and other != type_name:
                found[other] = None
                waiting.append(other)
    return tuple(found)


def fields_of(type_name: str) -> tuple[Field, ...]:
    """Return the fields of a message type in the order of the wire; constants are none.

    Raises:
        BagError: the type is not installed.
    """
    package = type_name.split("/")[0]
    found = []
    for line in message_text(type_name).splitlines():
        match = _FIELD.match(line.split("#")[0])
        if match:
            fixed = bool(match["length"]) and not match["bound"]
            found.append(
                Field(
                    name=match["name"],
                    type=match["type"] if match["type"] in PRIMITIVES else _full_name(match["type"], package),
                    array=match["array"] is not None,
                    length=int(match["length"]) if fixed else None,
                )
            )
    return tuple(found)


def message_text(type_name: str) -> str:
    """Return the text of a type's .msg file.

    Raises:
        BagError: the name is no message type, or no sourced prefix has its file.
    """
    return _file_of(type_name, ".msg").read_text(encoding="utf-8")


@functools.cache
def type_hash(type_name: str) -> str:
    """Return the type's RIHS01 hash, or an empty text where its package installs none."""
    try:
        description = json.loads(_file_of(type_name, ".json").read_text(encoding="utf-8"))
    except (BagError, ValueError):
        return ""
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description.get("type_hashes", [])}
    return str(hashes.get(type_name, ""))


def _full_name(name: str, package: str) -> str:
    """Spell a field's type as package/msg/Name."""
    if name == "Header":
        return "std_msgs/msg/Header"
    parts = name.split("/")
    return f"{parts[0]}/msg/{parts[-1]}" if len(parts) > 1 else f"{package}/msg/{name}"


def _file_of(type_name: str, suffix: str) -> Path:
    """Return the installed file that describes a type."""
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        raise BagError(f"message type {type_name!r}: expected a name like 'geometry_msgs/msg/PoseStamped'")
    for prefix in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        path = Path(prefix) / "share" / match["package"] / "msg" / f"{match['name']}{suffix}"
        if path.is_file():
            return path
    raise BagError(
        f"message type {type_name!r}: expected share/{match['package']}/msg/{match['name']}{suffix} below a prefix of "
        "AMENT_PREFIX_PATH, found none; source the workspace that has the package"
    )
