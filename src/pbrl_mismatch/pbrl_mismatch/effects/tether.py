"""An elastic cord to a fixed point."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, disc, on_body, plain, positive


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("tether_stiffness", 60.0, 1.0),
        plain("tether_x", float(scene.middle[0]), 1.2 * float(scene.reach[0])),
        plain("tether_y", float(scene.middle[1]), 1.2 * float(scene.reach[1])),
        positive("tether_length", 0.6, 0.7),
        on_body("tether_at_x", float(scene.centroid[0]), float(scene.half[0]), 0.6),
        on_body("tether_at_y", float(scene.centroid[1]), float(scene.half[1]), 0.6),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return disc("world", values["tether_x"], values["tether_y"], 0.05)


EFFECT = Effect(
    name="tether",
    summary="An elastic cord or a spring pulls the body to a fixed point, slack below a length.",
    equation="F = -k max(d - L, 0) along the cord from the anchor to its point on the body",
    shows="Go away from the anchor in more than one direction; slack must be entered and left.",
    parameters=parameters,
    variants=(
        (
            "tether_stiffness",
            "tether_x",
            "tether_y",
            "tether_length",
            "tether_at_x",
            "tether_at_y",
        ),
    ),
    where=where,
    place=("tether_x", "tether_y"),
    direction="anchor",
    linear=("tether_stiffness",),
    pulls=("tether_x", "tether_y", "tether_at_x", "tether_at_y"),
    cord="tether_length",
)
