"""What is drawn in an SVG file, on the floor: outlines with their place in the drawing, and what was not read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from xml.etree import ElementTree

from pbrl_control.planar import Array
from pbrl_namo.errors import NamoError
from pbrl_namo.scenes.svg_frame import read_length, read_numbers, read_transform, root_frame, viewport_frame
from pbrl_namo.scenes.svg_path import Outline, ellipse_outline, parse_path
from pbrl_namo.scenes.xml_text import parse_xml

SHAPES = ("path", "rect", "circle", "ellipse", "polygon", "polyline", "line")
GROUPS = ("g", "svg", "a")
NOT_DRAWN = (
    *("metadata", "namedview", "title", "desc", "namo_config", "grid", "guide", "perspective", "path-effect"),
    *("defs", "symbol", "clipPath", "mask", "pattern", "marker", "style", "filter", "linearGradient", "radialGradient"),
)
"""Elements by which nothing is drawn where they stand."""


@dataclass(frozen=True)
class Drawn:
    """One shape of a drawing.

    Attributes:
        name: its id; empty where it has none.
        tag: kind of element.
        attributes: without namespaces of drawing programs.
        groups: ids and types of the groups it is in, outermost first: (id, type, label).
        outlines: in `world` [m]; lines of a path that are not joined are several.
    """

    name: str
    tag: str
    attributes: Mapping[str, str]
    groups: tuple[tuple[str, str, str], ...]
    outlines: tuple[Outline, ...]

    def __str__(self) -> str:
        return f"<{self.tag}> {self.name!r}" if self.name else f"<{self.tag}> without id"


@dataclass
class Drawing:
    """A whole drawing.

    Attributes:
        sheet: extent (2,) of the sheet, its lower left corner in the origin of `world` [m].
        shapes: in the order in which they are drawn.
        config: the element `namo_config`; None where there is none.
        notes: sentences about what is not read.
    """

    sheet: Array
    shapes: list[Drawn] = field(default_factory=list)
    config: ElementTree.Element | None = None
    notes: list[str] = field(default_factory=list)


def read_drawing(text: bytes, what: str) -> Drawing:
    """Return what is drawn in an SVG file.

    Raises:
        NamoError: it is no SVG, or something in it cannot be taken as it is; with the id of what it is.
    """
    root = parse_xml(text, what)
    if local(root.tag) != "svg":
        raise NamoError(f"{what}: expected an <svg>, got a <{local(root.tag)[:40]}>")
    frame, sheet, notes = root_frame(root.attrib, what)
    drawing = Drawing(sheet, notes=notes)
    configs = [element for element in root.iter() if local(element.tag) == "namo_config"]
    if len(configs) > 1:
        raise NamoError(f"{what}: expected one namo_config, got {len(configs)}")
    drawing.config = configs[0] if configs else None
    unread: dict[str, list[str]] = {}
    for element in root:
        drawing.shapes += _walk(element, frame, (), unread)
    drawing.notes += [
        f"{len(names)} <{tag}> not read: {', '.join(names[:5])}{' ...' if len(names) > 5 else ''}."
        for tag, names in unread.items()
    ]
    return drawing


def local(tag: str) -> str:
    """Return a name without its namespace."""
    return tag.rsplit("}", 1)[-1]


def _walk(
    element: ElementTree.Element, frame: Array, groups: tuple[tuple[str, str, str], ...], unread: dict[str, list[str]]
) -> Iterator[Drawn]:
    """Yield the shapes of an element, given the (3, 3) matrix of what is around it; note what is not read."""
    tag, name = local(element.tag), element.get("id", "")
    if tag in NOT_DRAWN:
        return
    if tag not in SHAPES and tag not in GROUPS:
        unread.setdefault(tag, []).append(repr(name) if name else "without id")
        return
    if _hidden(element):
        unread.setdefault(f"{tag} display=none", []).append(repr(name) if name else "without id")
        return
    what = f"{name or 'without id'} <{tag}>"
    frame = frame @ read_transform(element.get("transform", ""), what)
    if tag in SHAPES:
        outlines = tuple(_placed(outline, frame) for outline in _outlines(element, tag, what))
        yield Drawn(name, tag, {local(key): value for key, value in _plain(element)}, groups, outlines)
        return
    if tag == "svg":
        frame = frame @ viewport_frame(element.attrib, what)
    label = next((value for key, value in element.attrib.items() if local(key) == "label"), "")
    inside = (*groups, (name, element.get("type", ""), label))
    for child in element:
        yield from _walk(child, frame, inside, unread)


def _plain(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield the attributes that have no namespace: `sodipodi:type` is not `type`."""
    return ((key, value) for key, value in element.attrib.items() if not key.startswith("{"))


def _hidden(element: ElementTree.Element) -> bool:
    """Say whether an element is not shown."""
    style = "".join(element.get("style", "").split())
    return element.get("display") == "none" or "display:none" in style.split(";")


def _placed(outline: Outline, frame: Array) -> Outline:
    """Return an outline by a (3, 3) matrix."""
    points = outline.array() @ frame[:2, :2].T + frame[:2, 2]
    return Outline(list(map(tuple, points.tolist())), outline.closed, outline.curved)


def _outlines(element: ElementTree.Element, tag: str, what: str) -> list[Outline]:
    """Return the outlines of a shape in its own units."""
    if tag == "path":
        return parse_path(element.get("d", ""), what)
    if tag in ("polygon", "polyline"):
        numbers = read_numbers(element.get("points", ""), f"{what}: points")
        if len(numbers) % 2:
            raise NamoError(f"{what}: points: expected pairs of numbers, got {len(numbers)} numbers")
        points = list(zip(numbers[::2], numbers[1::2], strict=True))
        return [Outline(points, closed=tag == "polygon")] if len(points) > 1 else []
    x, y, width, height = (_number(element, name, what) for name in ("x", "y", "width", "height"))
    if tag == "rect":
        rx, ry = (_number(element, name, what) for name in ("rx", "ry"))
        return _rectangle(x, y, width, height, min(rx or ry, width / 2.0), min(ry or rx, height / 2.0))
    if tag == "line":
        ends = [_number(element, name, what) for name in ("x1", "y1", "x2", "y2")]
        return [Outline([(ends[0], ends[1]), (ends[2], ends[3])])]
    cx, cy, r, rx, ry = (_number(element, name, what) for name in ("cx", "cy", "r", "rx", "ry"))
    return [ellipse_outline(cx, cy, r, r) if tag == "circle" else ellipse_outline(cx, cy, rx, ry)]


def _rectangle(x: float, y: float, width: float, height: float, rx: float, ry: float) -> list[Outline]:
    """Return a rectangle, its corners rounded by rx and ry."""
    if rx <= 0.0 or ry <= 0.0:
        return [Outline([(x, y), (x + width, y), (x + width, y + height), (x, y + height)], closed=True)]
    far_x, far_y, corner = x + width, y + height, f"A{rx!r},{ry!r} 0 0 1"
    sides = (
        f"M{x + rx!r},{y!r}H{far_x - rx!r}{corner} {far_x!r},{y + ry!r}V{far_y - ry!r}{corner} {far_x - rx!r},{far_y!r}"
        f"H{x + rx!r}{corner} {x!r},{far_y - ry!r}V{y + ry!r}{corner} {x + rx!r},{y!r}Z"
    )
    return parse_path(sides, "<rect>")


def _number(element: ElementTree.Element, name: str, what: str) -> float:
    """Return a length of a shape in units of the drawing; 0 where it is not told."""
    length = read_length(element.get(name), f"{what}: {name}")
    if length is not None and length[1] not in ("", "px"):
        raise NamoError(f"{what}: {name}: expected units of the drawing, got {element.get(name)!r}")
    return 0.0 if length is None else length[0]
