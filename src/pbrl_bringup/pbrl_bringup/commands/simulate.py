"""`./pbrl simulate SCENE --out BAG`: a push in one process, recorded."""

from __future__ import annotations

from pathlib import Path

from bullet_sim.scene import load_scene
from pbrl_bringup.errors import BringupError
from pbrl_bringup.simulate import simulate_push
from pbrl_bringup.terminal import output, progress
from pbrl_control.push_plan import load_plan


def command(scene: str, push: str, seed: int, out: Path, gui: bool) -> int:
    """Simulate and record one push.

    Raises:
        BringupError: `out` exists, or the push failed; what was recorded until then is kept.
    """
    loaded = load_scene(scene)
    plan = load_plan(push)
    with progress(f"pushing {plan.object}", total=None) as bar:
        made = simulate_push(
            loaded, plan, seed, out, gui=gui, advance=lambda time, phase: bar(time, f"{phase}, {time:.1f} s")
        )
    output().print(f"{made.bag}: {made.messages} messages, {made.seconds:.1f} s, seed {seed}")
    if made.phase != "done":
        raise BringupError(f"push {plan.name} failed: {made.status}; {out} holds the recording until then")
    return 0
