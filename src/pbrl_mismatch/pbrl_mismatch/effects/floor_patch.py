"""A region of the floor with another friction."""

from __future__ import annotations

from pbrl_mismatch.effects.effect import Effect, Parameter, Scene, Values, Where, plain, positive, rectangle


def parameters(scene: Scene) -> tuple[Parameter, ...]:
    """Return what is believed of its parameters."""
    return (
        positive("patch_mu", 0.1, 1.0),
        plain("patch_x", float(scene.middle[0]), float(scene.reach[0])),
        plain("patch_y", float(scene.middle[1]), float(scene.reach[1])),
        positive("patch_length", 0.6, 0.7),
        positive("patch_width", 0.6, 0.7),
        plain("patch_theta", 0.0, 0.8),
        positive("patch_roll", 0.02, 1.0),
        plain("load_x", 0.0, 0.3 * float(scene.half[0])),
        plain("load_y", 0.0, 0.3 * float(scene.half[1])),
        positive("load_height", 0.5, 0.7),
    )


def where(values: Values, scene: Scene) -> Where | None:
    """Return the place that it has."""
    return rectangle(
        "world",
        values["patch_x"],
        values["patch_y"],
        values["patch_length"],
        values["patch_width"],
        values["patch_theta"],
    )


EFFECT = Effect(
    name="floor_patch",
    summary="A region of the floor, such as a carpet, has friction of its own, with a border.",
    equation="friction mu_p at each foot in a rectangle on the floor; a wheel there rolls against roll m g",
    shows="The border must be crossed, by some points before others; go back over it from another side.",
    parameters=parameters,
    variants=(
        (
            "patch_mu",
            "patch_x",
            "patch_y",
            "patch_length",
            "patch_width",
            "patch_theta",
            "patch_roll",
            "load_x",
            "load_y",
            "load_height",
        ),
    ),
    where=where,
    place=("patch_x", "patch_y"),
    direction="velocity",
    angles=("patch_theta",),
    linear=("patch_mu", "patch_roll"),
    region=("patch_x", "patch_y", "patch_length", "patch_width", "patch_theta"),
    sticks=True,
)
