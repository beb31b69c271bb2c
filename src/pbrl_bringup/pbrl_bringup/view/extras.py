"""What a graph says beside poses and wrenches: plans, learned models, what was found to be left out."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from pbrl_bag.decoding import seconds
from pbrl_bringup.view.diagnosed import Found
from pbrl_bringup.view.models import told_model

Array = NDArray[np.float64]

LINE_STRIP, LINE_LIST, ADD, DELETE, DELETE_ALL = 4, 5, 0, 2, 3
"""Of visualization_msgs/Marker."""
MOST_PLANS = 2000
"""Kept; of more, the oldest are forgotten."""
WORLD = ("world", "map", "")
"""Frames in which a plan can be drawn as it is."""
DRAWN_ALREADY = ("bodies",)
"""Namespaces of markers that say again what poses and outlines say."""


class Extras:
    """Collects messages; `version` grows with everything that changes what is drawn."""

    def __init__(self) -> None:
        self.version = 0
        self.plans: list[dict[str, Any]] = []
        self.models: dict[str, dict[str, Any]] = {}
        self.found: dict[str, Found] = {}
        self.notes: list[str] = []

    def hearers(self) -> dict[str, Callable[[Any], None]]:
        """Return what takes the messages of a topic, by topic."""
        return {
            "/plan": self._plan,
            "/markers": self._markers,
            "/object_models": self._models,
            "/mismatches": self._mismatches,
        }

    def plans_since(self, origin: float) -> list[dict[str, Any]]:
        """Return the plans with times on the page's clock, which is zero at `origin` [s]."""
        return [
            {
                "time": each["time"] - origin,
                "until": None if each["until"] is None else each["until"] - origin,
                "points": each["points"],
                "pairs": each["pairs"],
            }
            for each in self.plans
        ]

    def _plan(self, message: Any) -> None:
        if str(message.header.frame_id).lstrip("/") not in WORLD:
            self._note("/plan is in another frame than world or map, and is not drawn")
            return
        points = [(pose.pose.position.x, pose.pose.position.y) for pose in message.poses]
        self._draw("/plan", seconds(message.header.stamp), points)

    def _markers(self, message: Any) -> None:
        """Take lines; what else there is among markers is drawn by RViz and Foxglove."""
        for marker in message.markers:
            time, key = seconds(marker.header.stamp), f"/markers {marker.ns} {marker.id}"
            if marker.action == DELETE_ALL:
                for each in [plan for plan in self.plans if plan["key"].startswith("/markers")]:
                    self._close(each["key"], time)
            elif marker.action == DELETE:
                self._close(key, time)
            elif self._is_drawn(marker):
                self._draw(key, time, _placed(marker), pairs=marker.type == LINE_LIST)

    def _is_drawn(self, marker: Any) -> bool:
        lines = marker.type in (LINE_STRIP, LINE_LIST) and marker.ns not in DRAWN_ALREADY
        return lines and str(marker.header.frame_id).lstrip("/") in WORLD

    def _draw(self, key: str, time: float, points: list[tuple[float, float]], *, pairs: bool = False) -> None:
        rows = np.array(points, dtype=np.float64).reshape(-1, 2)
        told = np.round(rows[np.isfinite(rows).all(axis=1)], 4).tolist()
        last = next((each for each in reversed(self.plans) if each["key"] == key and each["until"] is None), None)
        if last is not None and last["points"] == told:
            return
        self._close(key, time)
        if len(told) > 1:
            self.plans = [*self.plans, {"key": key, "time": time, "until": None, "points": told, "pairs": pairs}][
                -MOST_PLANS:
            ]
            self.version += 1

    def _close(self, key: str, time: float) -> None:
        for each in self.plans:
            if each["key"] == key and each["until"] is None:
                each["until"] = time
                self.version += 1

    def _models(self, message: Any) -> None:
        self.version += 1
        self.models = {}
        for model in message.models:
            names = [str(name) for name in model.parameters]
            samples = np.array(model.samples, dtype=np.float64)
            several = (model.mean, model.sd, model.units)
            fit = names and all(len(each) == len(names) for each in several)
            if not fit or len(samples) != len(names) * int(model.draws) or not np.isfinite(samples).all():
                self._note(f"/object_models: the draws of {model.object!r} do not fit its parameters: not drawn")
                continue
            numbers = list(zip(names, map(float, model.mean), map(float, model.sd), map(str, model.units), strict=True))
            draws = dict(zip(names, samples.reshape(-1, len(names)).T, strict=True))
            self.models[str(model.object)] = told_model(str(model.model_class), numbers, draws)

    def _mismatches(self, message: Any) -> None:
        self.version += 1
        self.found = {}
        for each in message.mismatches:
            try:
                self.found[str(each.object)] = _found(each)
            except ValidationError:
                self._note(f"/mismatches: what is told of {each.object!r} is no finding: not drawn")

    def _note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)
            self.version += 1


def _placed(marker: Any) -> list[tuple[float, float]]:
    """Return the points of a marker in its frame: those of a marker that has a pose lie about that."""
    at, turn = marker.pose.position, marker.pose.orientation
    theta = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y * turn.y + turn.z * turn.z))
    c, s = math.cos(theta), math.sin(theta)
    return [(at.x + c * point.x - s * point.y, at.y + s * point.x + c * point.y) for point in marker.points]


def _found(mismatch: Any) -> Found:
    """Return one mismatch; its report has more than the message's own fields, once there is one."""
    if mismatch.report:
        try:
            return Found.model_validate(json.loads(mismatch.report))
        except (ValidationError, ValueError, RecursionError):
            pass  # the fields below say the rest
    effects = [
        {
            "effect": str(each.effect),
            "probability": each.probability,
            "where": {"frame": str(each.where_frame), "shape": [(p.x, p.y) for p in each.where]}
            if each.where_frame
            else None,
        }
        for each in mismatch.effects
    ]
    return Found.model_validate({"mismatch": True, "unknown": bool(mismatch.unknown), "effects": effects})
