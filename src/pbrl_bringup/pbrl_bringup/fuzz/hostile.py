"""Values that break readers: numbers, names, and documents that grow when they are read."""

from __future__ import annotations

import math
from typing import Final

NUMBERS: Final[tuple[float | int, ...]] = (
    *(math.nan, math.inf, -math.inf, 1e308, -1e308, 1e-308, 5e-324, 1e300, 1e30, 1e16, 1e9, -1e9, 1e-9),
    *(0, -1, 1, 2, -0.0, 0.5, 255, 256, 65535, 65536, 2**31 - 1, 2**31, -(2**31), 2**32, 2**53 + 1, 2**63 - 1),
    *(2**63, -(2**63), 2**64, 10**25, 10**400, 999_999_999, 1_000_000_000, 20_000_000, 100_000),
)
TEXTS: Final[tuple[str, ...]] = (
    *("", " ", ".", "..", "/", "../../outside", "../outside.png", "/tmp/outside", "~/outside", "a/../../outside"),
    *(
        "/dev/zero",
        "/dev/stdin",
        "/proc/self/mem",
        "/etc/passwd",
        "file:///etc/passwd",
        "con\x00cealed",
        "a\nb",
        "\r\n",
    ),
    *(
        "\x1b[2J",
        "\u202e",
        "\ufeff",
        "\ud83d\ude00".encode("utf-16", "surrogatepass").decode("utf-16"),
        "ﬀ",
        "Ⅷ",
        "٣",
        "²",
    ),
    *("<script>alert(1)</script>", "'\"><img src=x onerror=alert(1)>", "{{7*7}}", "${7*7}", "%s%n", "__class__"),
    *("[bold]", "[/]", "[/red]", "[link=x]", "x" * 300, "x" * 20_000, "é" * 200, "-1", "1e999", "nan", ".inf", "0x10"),
    *(
        "1_000",
        "0o17",
        "1:30",
        "null",
        "true",
        "no",
        "2001-01-01",
        "!!python/object/apply:os.system [id]",
        "world",
        "map",
    ),
)
"""Some hold no text that can be written as UTF-8 or XML; who writes them leaves out what cannot be."""
NOTHINGS: Final[tuple[object, ...]] = (None, True, False, [], {}, [[]], [None], {"": None}, [[[[]]]])


def _laughs(levels: int) -> str:
    """Return YAML in which each of some levels is nine of the one before."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, levels)]
    return "\n".join(lines)


def _merges(levels: int) -> str:
    """Return YAML whose mappings take each other in, twice at each level."""
    lines = ["m0: &m0 {x: 1}"]
    lines += [f"m{k}: &m{k} {{<<: [*m{k - 1}, *m{k - 1}], k{k}: 1}}" for k in range(1, levels)]
    return "\n".join(lines)


YAML_BOMBS: Final[tuple[str, ...]] = (
    *(_laughs(9), _merges(22), "a: &a [*a]", "&a {*a : *a}", "&a\nx: *a", "[" * 3000, "{a: " * 3000, "- " * 3000),
    *("!!python/object/apply:os.system ['touch outside']", "!!python/name:os.system", "!!binary x", "!!timestamp x"),
    *("? [a, b]\n: c", "? {a: 1}\n: c", "<<: 1", "<<: [1]", "x: !!set {a, b}", "x: !!omap [a: 1]", "x: !!pairs [a: 1]"),
    *("%YAML 9.9\n---\na: 1", "--- a\n--- b", "a: 1\n...\nb: 2", "a: '", "\t", "a: !!int 'x'", "a: !!float 'x'"),
    *(
        "a: 2001-13-45",
        "a: 0b",
        "a: 0x",
        "a: -_1",
        "a: 190:20:30",
        "a: " + "9" * 5000,
        "a: 1" + "_" * 2000,
        "a: =",
        "=",
    ),
)
JSON_BOMBS: Final[tuple[str, ...]] = (
    *(
        "[" * 100_000,
        '{"a":' * 100_000,
        "9" * 5000,
        "-",
        "NaN",
        "[NaN, Infinity]",
        '"\\ud800"',
        '{"a": 1, "a": 2}',
        "null",
    ),
    *("1e999", "[1,]", "\ufeff{}", '{"objects": {"\\ud800": {}}}', '{"a": 1' + "0" * 4999 + "}"),
)
_ENTITIES = "".join(f'<!ENTITY l{k} "{f"&l{k - 1};" * 10}">' for k in range(1, 10))
XML_BOMBS: Final[tuple[str, ...]] = (
    f'<?xml version="1.0"?><!DOCTYPE svg [<!ENTITY l0 "lol">{_ENTITIES}]><svg>&l9;</svg>',
    '<!DOCTYPE svg [<!ENTITY x SYSTEM "file:///etc/passwd">]><svg>&x;</svg>',
    '<!DOCTYPE svg SYSTEM "http://127.0.0.1:1/x.dtd"><svg/>',
    '<!DOCTYPE svg [<!ENTITY % p SYSTEM "file:///etc/passwd">%p;]><svg/>',
    "<svg>" * 50_000,
    "<svg " + " ".join(f'a{k}="1"' for k in range(5000)) + "/>",
    '<?xml version="1.0" encoding="utf-7"?><svg/>',
    '<?xml version="1.0" encoding="utf-16"?><svg/>',
    '<?xml version="1.0" encoding="idna"?><svg/>',
    "<svg xmlns:x='" + "y" * 50_000 + "'/>",
)
