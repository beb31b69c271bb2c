"""Maps as ROS keeps them: a YAML file beside an image (`map_server`)."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pbrl_bag.yaml_text import parse_yaml
from pbrl_planner.errors import PlannerError
from pbrl_planner.lattice.bare_png import PNG, bare_png
from pbrl_planner.lattice.grid import DEAREST, LETHAL, MOST_CELLS, CostGrid

LARGEST = 512 * 2**20
"""[bytes] of an image file."""
HEAD = 4096
"""[bytes] in which a PGM says how large it is."""
KEYS = {"image", "mode", "resolution", "origin", "negate", "occupied_thresh", "free_thresh"}


def read_map(
    path: Path | str,
    *,
    unknown: Literal["occupied", "free"] = "occupied",
    near: float = 0.0,
    nearest: int = 20,
) -> CostGrid:
    """Read a map; row 0 of the grid is the image's last.

    Mode `trinary`: occupied, free or unknown. Mode `scale`: what is between the thresholds costs the more, the more
    likely it is occupied. Mode `raw`: pixels are the likelihood in per cent, above 100 unknown.

    Args:
        path: of the YAML file.
        unknown: what becomes of unknown cells.
        near: distance from obstacles at which their cost ends [m]; see `CostGrid.of_occupied`.
        nearest: cost right beside them; where the map says one as well, the larger counts.

    Raises:
        PlannerError: the files are not what they should be: file, key, what was expected and got.
    """
    path = Path(path)
    said = _yaml(path)
    resolution = _number(path, said, "resolution", 0.0, 100.0)
    origin = said.get("origin")
    numbers = isinstance(origin, list) and all(isinstance(v, int | float) and math.isfinite(v) for v in origin)
    if not (numbers and isinstance(origin, list) and len(origin) in (2, 3)):
        raise PlannerError(f"{path}: expected origin: [x, y, yaw], got {str(origin)[:60]}")
    if len(origin) == 3 and abs(origin[2]) > 1e-9:
        raise PlannerError(f"{path}: expected an origin with yaw 0, got {origin[2]}; turn the image instead")
    mode = said.get("mode", "trinary")
    if mode not in ("trinary", "scale", "raw"):
        raise PlannerError(f"{path}: expected mode: trinary, scale or raw, got {str(mode)[:60]!r}")
    negate = said.get("negate", 0)
    if negate not in (0, 1):
        raise PlannerError(f"{path}: expected negate: 0 or 1, got {str(negate)[:60]!r}")
    occupied = _number(path, said, "occupied_thresh", -1e-9, 1.0, 0.65)
    free = _number(path, said, "free_thresh", -1e-9, 1.0, 0.25)
    if free > occupied:
        raise PlannerError(f"{path}: expected free_thresh at most occupied_thresh, got {free} and {occupied}")
    image = said.get("image")
    if not isinstance(image, str) or not image:
        raise PlannerError(f"{path}: expected image: a file name, got {str(image)[:60]!r}")
    pixels, clear = _pixels(path.parent / image)
    if mode == "raw":
        likelihood = pixels / 100.0
        clear |= pixels > 100.0
    else:
        likelihood = pixels / 255.0 if negate else (255.0 - pixels) / 255.0
    taken, open_ = likelihood > occupied, likelihood < free
    if mode == "raw":
        taken, open_ = pixels == 100.0, pixels < 100.0
    between = ~taken & ~open_
    cells = np.zeros(pixels.shape, dtype=np.uint8)
    if mode == "scale":
        share = (likelihood - free) / max(occupied - free, 1e-9)
        cells[between] = np.round(np.clip(share[between], 0.0, 1.0) * DEAREST).astype(np.uint8)
        between &= False
    elif mode == "raw":
        cells[open_] = np.round(likelihood[open_] * DEAREST).astype(np.uint8)
    hidden = between | clear
    stands = (taken & ~clear) | (hidden if unknown == "occupied" else np.zeros_like(hidden))
    cells[hidden] = 0
    dear = CostGrid.of_occupied(stands, resolution, near=near, nearest=nearest).cells
    cells = np.maximum(cells, dear)
    cells[stands] = LETHAL
    return CostGrid(cells[::-1], resolution, (float(origin[0]), float(origin[1])))


def _yaml(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > 1 << 20:
            raise PlannerError(f"{path}: expected a short YAML file, got {path.stat().st_size} bytes")
        content = parse_yaml(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise PlannerError(f"{path}: expected a readable YAML file, got {error}") from error
    if not isinstance(content, dict):
        raise PlannerError(f"{path}: expected keys and values, got {type(content).__name__}")
    strange = [str(key) for key in content if key not in KEYS]
    if strange:
        raise PlannerError(f"{path}: expected keys {', '.join(sorted(KEYS))}, got {strange[0][:60]!r}")
    return content


def _number(path: Path, said: dict[str, Any], key: str, low: float, high: float, default: float | None = None) -> float:
    value = said.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low < value <= high:
        raise PlannerError(f"{path}: expected {key}: a number above {low:g}, at most {high:g}, got {str(value)[:60]!r}")
    return float(value)


def _pixels(path: Path) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return an image's pixels (rows, columns), 0 to 255, colours averaged, and where it is transparent."""
    try:
        if not path.is_file():  # a pipe would be waited for, a device read for ever
            raise PlannerError(f"{path}: expected a readable PGM or PNG image, got no such file")
        with path.open("rb") as file:
            data = file.read(LARGEST + 1)
    except (OSError, ValueError) as error:
        raise PlannerError(f"{path}: expected a readable PGM or PNG image, got {error}") from error
    width, height = _size(path, data[:HEAD])
    if len(data) > LARGEST or not 1 <= width * height <= MOST_CELLS:
        raise PlannerError(f"{path}: expected an image of at most {MOST_CELLS} pixels, got {width} x {height}")
    try:
        whole = bare_png(data) if data.startswith(PNG) else data
        image = cv2.imdecode(np.frombuffer(whole, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except (cv2.error, ValueError):
        image = None
    if image is None or image.shape[:2] != (height, width):
        raise PlannerError(f"{path}: expected a whole image of {width} x {height} pixels, got one that ends early")
    scale = 255.0 / (65535 if image.dtype == np.uint16 else 255)
    pixels = image.astype(float).reshape(height, width, -1) * scale
    clear = pixels[..., -1] < 255.0 if pixels.shape[2] in (2, 4) else np.zeros((height, width), dtype=bool)
    return pixels[..., : 3 if pixels.shape[2] >= 3 else 1].mean(axis=2), clear


def _size(path: Path, head: bytes) -> tuple[int, int]:
    """Return the width and height that an image says it has, before anything is unpacked."""
    if head.startswith(PNG) and len(head) >= 24:
        return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")
    if head[:2] in (b"P2", b"P5"):
        words = re.sub(rb"#[^\n]*", b" ", head[2:]).split()
        if len(words) >= 2 and all(word.isdigit() and len(word) < 10 for word in words[:2]):
            return int(words[0]), int(words[1])
    raise PlannerError(f"{path}: expected a PGM or PNG image, got something else")
