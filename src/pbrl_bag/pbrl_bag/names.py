"""Names of topics, services and actions of a robot that may have a namespace of its own.

Everything that learns or plans calls a topic by its name in the root namespace, "/wrist_ft/left". On the wire it may
be "/robot_1/wrist_ft/left". Nodes give their endpoints relative names; what is found in a graph or in a bag is called
by its name in the root again, so that nothing else has to know of namespaces.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from pbrl_bag.errors import BagError

GLOBAL = ("/clock", "/tf", "/tf_static")
"""Absolute in every stack; a rule such as `-r /tf:=/robot_1/tf` gives a robot its own."""

_CONTRACT = re.compile(r"(?P<namespace>(/[^/]+)*?)(/scene|/grasps|/wrist_ft/(left|right)|/ar_tags/[^/]+/pose)")


def relative(name: str) -> str:
    """Return a name such that it lies in the namespace of the node that uses it; what is global stays so."""
    return name if name in GLOBAL else name.removeprefix("/")


def in_namespace(name: str, namespace: str) -> str:
    """Return the name on the wire of what is called `name` in the root namespace.

    Args:
        name: absolute.
        namespace: absolute, "/" or empty for the root.
    """
    return namespace.rstrip("/") + name


def canonical(name: str, namespace: str) -> str | None:
    """Return what a name on the wire would be in the root namespace; None: it belongs to somebody else.

    Args:
        name: absolute.
        namespace: absolute, "/" or empty for the root, which owns every name.
    """
    prefix = namespace.rstrip("/") + "/"
    return name[len(prefix) - 1 :] if name.startswith(prefix) else None


def hidden(name: str) -> bool:
    """Tell whether a name is left out of lists of names, as those of an action are: a token of it begins with _."""
    return "/_" in name


def namespace_of(topics: Iterable[str], where: str) -> str:
    """Return the namespace of the robot that a recording is of: empty, the root, or the only one that there is.

    Args:
        topics: of the recording.
        where: it is, for the error.

    Raises:
        BagError: there are several robots, and none in the root namespace.
    """
    found = {match["namespace"] for topic in topics if (match := _CONTRACT.fullmatch(topic))}
    if "" in found or not found:
        return ""
    if len(found) > 1:
        raise BagError(
            f"{where}: expected the topics of one robot, got those of {' and '.join(sorted(found))}; "
            "say in a mapping which topics are meant, or record with `./pbrl record --namespace NAME`"
        )
    return found.pop()
