"""What a fit can be told. An unknown option or a value out of range is an error."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pbrl_model.engines.windowed import EngineName
from pbrl_model.errors import ModelError
from pbrl_model.parameters import nearest
from pbrl_model.prior_options import PriorOptions
from pbrl_model.sensing.gravity import GravityMethod

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
SamplerName = Literal["importance", "metropolis"]
LikelihoodName = Literal["windowed", "one_step", "integrated"]


class FitOptions(BaseModel):
    """Settings of `fit_recording`.

    Attributes:
        model_class: what a body may have: nothing but mass, a wheel (the thesis's class), a wheel and friction of the
            whole body on the floor, or a hinge.
        likelihood: "windowed" (multiple shooting), "one_step" (thesis 25) or "integrated" (39).
        sampler: "importance" (adaptive, from a mixture at the modes, with an evidence) or "metropolis" (block-wise
            chains from the modes, as in the thesis).
        engine: what simulates in the likelihood, "kernel" (compiled) or "pymunk" (as in the thesis, some hundred times
            slower). Modes are sought on the kernel either way; the posterior is the engine's.
        objects: names to learn; empty: every object that was held.
        priors: settings of table 2's priors.
        window: length of a window [s].
        draws: kept from each chain; importance sampling returns as many as all chains together.
        chains: how many.
        burn_in: steps of each chain in which it adapts; Metropolis only.
        thin: steps for each draw kept; Metropolis only.
        search_draws: draws from the prior that the search starts with.
        seed: of every random draw.
        holdout_share: share of the windows that is left out of the fit and predicted; 0: none.
        holdout_episodes: so many of the last episodes are left out instead, and predicted open loop.
        left_out_force: most likely size of what the model leaves out [N]; None: as the model class has it,
            see `pbrl_model.fitting.likelihood`.
        gravity: how raw wrenches are compensated, see `pbrl_model.sensing.gravity`.

    Raises:
        ModelError: an option is unknown or out of range.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, arbitrary_types_allowed=True)

    model_class: Literal["free", "wheel", "wheel+ground", "hinge"] = "wheel+ground"
    likelihood: LikelihoodName = "windowed"
    sampler: SamplerName = "importance"
    engine: EngineName = "kernel"
    objects: tuple[str, ...] = ()
    priors: PriorOptions = PriorOptions()
    window: Annotated[float, Field(ge=0.2, le=60.0)] = 1.5
    draws: Annotated[int, Field(ge=1, le=1_000_000)] = 500
    chains: Annotated[int, Field(ge=1, le=256)] = 4
    burn_in: Annotated[int, Field(ge=0, le=1_000_000)] = 1000
    thin: Annotated[int, Field(ge=1, le=10_000)] = 8
    search_draws: Annotated[int, Field(ge=10, le=1_000_000)] = 600
    seed: Annotated[int, Field(ge=0)] = 0
    holdout_share: Annotated[float, Field(ge=0.0, le=0.5)] = 0.1
    holdout_episodes: Annotated[int, Field(ge=0)] = 0
    left_out_force: Positive | None = None
    gravity: GravityMethod = "weight"

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            if first["type"] == "extra_forbidden":
                hint = nearest(place, list(type(self).model_fields))
                raise ModelError(f"fit options: unknown option {place!r}{hint}") from None
            raise ModelError(f"fit options: {place}: {first['msg']}, got {first['input']!r}") from None
