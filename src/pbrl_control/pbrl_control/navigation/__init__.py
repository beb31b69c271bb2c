"""Ways of a differential base to a pose among polygons: map, footprint, path, tracker."""

from pbrl_control.navigation.floor_map import FloorMap
from pbrl_control.navigation.footprint import KRANG_STOWED, Footprint, reaching_arms
from pbrl_control.navigation.motion import MotionChecker
from pbrl_control.navigation.path import BasePath, Leg
from pbrl_control.navigation.route import RouteResult, plan_route
from pbrl_control.navigation.settings import TrackerSettings
from pbrl_control.navigation.struck import Struck
from pbrl_control.navigation.tracker import PathTracker, TrackCommand, TrackStatus

__all__ = [
    "KRANG_STOWED",
    "BasePath",
    "FloorMap",
    "Footprint",
    "Leg",
    "MotionChecker",
    "PathTracker",
    "RouteResult",
    "Struck",
    "TrackCommand",
    "TrackStatus",
    "TrackerSettings",
    "plan_route",
    "reaching_arms",
]
