"""PNG files that anybody may have made, before a library unpacks them.

OpenCV believes what a chunk says of its length: a picture of a hundred bytes had it take gigabytes, one cut short had
it wait for ever.
"""

from __future__ import annotations

import zlib

PNG = b"\x89PNG\r\n\x1a\n"
_NEEDED = (b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND")
"""Chunks that a still picture is made of; texts, colour profiles and frames of animations are left out."""


def bare_png(data: bytes) -> bytes:
    """Return a PNG of nothing but its picture.

    Raises:
        ValueError: it is none, a chunk is longer than the file or damaged, or it does not end.
    """
    if not data.startswith(PNG):
        raise ValueError("no PNG")
    parts, at = [PNG], len(PNG)
    while at + 12 <= len(data):
        kind, end = data[at + 4 : at + 8], at + 12 + int.from_bytes(data[at : at + 4], "big")
        if end > len(data) or zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise ValueError(f"a chunk at byte {at} that is cut short or damaged")
        if kind in _NEEDED:
            parts.append(data[at:end])
        if kind == b"IEND":
            return b"".join(parts)
        at = end
    raise ValueError("a PNG without an end")
