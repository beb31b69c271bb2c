"""What was concealed, sealed: its hash is told before a diagnosis begins, its content only to the scorer."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass, field


@dataclass(frozen=True)
class Truth:
    """What is true of a recording and not told.

    Attributes:
        effects: names of what was concealed; empty: nothing.
        body: whose motion it acts on.
        settings: of the effects, as a scene has them.
        when: (start, end) in which each effect acted, by name [s].
        place: corners or points (x, y) of an effect that has one, in `world` [m], by name.
        strength: where between barely and strongly the effect was drawn, 0 to 1.
        share: of the time in which the object moved that an effect acted, by name.
        told: what the oracle is told, in columns of the effects library.
    """

    effects: tuple[str, ...]
    body: str
    settings: dict[str, object]
    when: dict[str, list[tuple[float, float]]]
    place: dict[str, list[tuple[float, float]]]
    strength: float
    share: dict[str, float]
    told: dict[str, float] = field(default_factory=dict)

    def seal(self) -> str:
        """Return the SHA-256 of the truth as canonical JSON."""
        return hashlib.sha256(json.dumps(asdict(self), sort_keys=True).encode()).hexdigest()
