"""Baselines of the thesis: linear regression, locally weighted regression, and the same with contact sectors."""

from pbrl_model.baselines.linear import LinearRegression
from pbrl_model.baselines.local import LocallyWeightedRegression
from pbrl_model.baselines.object_oriented import ObjectOrientedRegression
from pbrl_model.baselines.sectors import ContactSectors

__all__ = ["ContactSectors", "LinearRegression", "LocallyWeightedRegression", "ObjectOrientedRegression"]
