"""A worker outlives a command: its library has the effects that a piece is told of, and no others of one's own."""

from __future__ import annotations

from pathlib import Path

import pytest

from pbrl_bringup.commands.diagnose import only_effects
from pbrl_mismatch import MismatchError
from pbrl_mismatch.effects.own import own_effects

FILE = """
from pbrl_mismatch import OwnEffect, Prior, register_effect
law = lambda t, p, v, q: (q[0], 0.0, 0.0)
register_effect(OwnEffect(name='{name}', summary='A push.', law=law, units={{'force': 'N'}},
    priors=lambda scene: {{'force': Prior(0.0, 0.4 * scene.force)}}, strength=('force',)))
"""


def test_effects_of_an_earlier_piece_are_gone(tmp_path: Path) -> None:
    files = {name: (tmp_path / f"{name}.py", FILE.format(name=name).encode()) for name in ("mine", "yours")}
    for path, text in files.values():
        path.write_bytes(text)
    broken = (tmp_path / "broken.py", b"1 / 0")
    broken[0].write_bytes(broken[1])
    try:
        for wanted in (("mine",), ("mine", "yours"), ("yours",), ("yours",), ()):
            only_effects(tuple(files[name] for name in wanted))
            assert own_effects() == wanted
        with pytest.raises(MismatchError, match="ZeroDivisionError"):
            only_effects((files["mine"], broken))
    finally:
        only_effects(())
    assert own_effects() == ()
