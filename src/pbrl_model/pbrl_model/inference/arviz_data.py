"""An inference as ArviZ `InferenceData`: named parameters with units, for its plots and tables."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pbrl_model.arviz_import import az
from pbrl_model.errors import ModelError
from pbrl_model.inference.infer import Inference
from pbrl_model.parameters import UNITS


def to_inference_data(found: Inference, units: Mapping[str, str] = UNITS) -> Any:
    """Return the draws of equal weight as one chain, one variable a parameter; what is known of them as attributes.

    Args:
        found: with at least one draw.
        units: by parameter; "1" for those that are not in it.

    Raises:
        ModelError: there are no draws.
    """
    if len(found.draws) == 0:
        raise ModelError(f"inference: expected draws to hand over, got none; {'; '.join(found.notes)}")
    columns = zip(found.names, found.draws.T, strict=True)
    data = az().from_dict(posterior={name: column[None].copy() for name, column in columns})
    group = data["posterior"]
    for name in found.names:
        group[name].attrs["units"] = units.get(name, "1")
    group.attrs.update(
        {
            "log_evidence": found.log_evidence,
            "log_evidence_sd": found.log_evidence_sd,
            "ess": found.ess,
            "pareto_k": found.pareto_k,
            "calls": found.calls,
            "converged": int(found.converged),
            "notes": json.dumps(found.notes),
        }
    )
    return data
