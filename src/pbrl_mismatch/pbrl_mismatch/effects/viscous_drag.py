"""Drag that grows with speed."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("drag_linear", 0.3 * scene.force / scene.speed, 1.3),
        positive("drag_turn", 0.3 * scene.force / scene.speed * scene.size**2 / 3.0, 1.5),
    )


EFFECT = Effect(
    name="viscous_drag",
    summary="Force and moment against the motion grow with speed.",
    equation="F = -c v, tau = -c_r omega",
    shows="Varied speed; at one speed it is ground friction. A wheel that creeps looks viscous too.",
    parameters=parameters,
    variants=(
        (
            "drag_linear",
            "drag_turn",
        ),
        ("drag_linear",),
    ),
    direction="velocity",
    linear=("drag_linear", "drag_turn"),
    exact=True,
)
