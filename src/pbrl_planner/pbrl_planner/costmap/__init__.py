"""Costmaps: what a static map and laser scans say of the floor around the robot, inflated (thesis 4.4, figure 13)."""

from pbrl_planner.costmap.costmap import Costmap, Recovery, ScanReport
from pbrl_planner.costmap.field import FREE, INSCRIBED, LETHAL, UNKNOWN, CostField
from pbrl_planner.costmap.inflation import inflate, squared_distances
from pbrl_planner.costmap.scan import RangeScan
from pbrl_planner.costmap.settings import CostmapSettings, EvidenceSettings, InflationSettings, OverhangSettings
from pbrl_planner.costmap.static_map import StaticMap

__all__ = [
    "FREE",
    "INSCRIBED",
    "LETHAL",
    "UNKNOWN",
    "CostField",
    "Costmap",
    "CostmapSettings",
    "EvidenceSettings",
    "InflationSettings",
    "OverhangSettings",
    "RangeScan",
    "Recovery",
    "ScanReport",
    "StaticMap",
    "inflate",
    "squared_distances",
]
