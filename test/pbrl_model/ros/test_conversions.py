"""Posteriors as messages, through real serialization, and as markers."""

from __future__ import annotations

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from pbrl_msgs.msg import ObjectModel, ObjectModels
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

from pbrl_model.errors import ModelError
from pbrl_model.parameters import MODEL_CLASSES, free_columns
from pbrl_model.posterior import Posterior
from pbrl_model.ros.conversions import models_from_msg, models_to_msg, posterior_from_msg, posterior_to_msg
from pbrl_model.ros.markers import model_markers

STAMP = Time(sec=12, nanosec=34)


def posterior(name: str, scale: float = 0.1) -> Posterior:
    names = free_columns(name)
    draws = 0.3 + scale * np.random.default_rng(0).normal(size=(2, 40, len(names)))
    return Posterior(
        f"table {name}", name, names, draws, log_evidence=float("nan"), heldout_rmse=0.01, notes=("vague",)
    )


@pytest.mark.parametrize("name", MODEL_CLASSES)
def test_messages_round_trip_through_serialization(name: str) -> None:
    found = posterior(name)
    wire = deserialize_message(serialize_message(posterior_to_msg(found)), ObjectModel)
    back = posterior_from_msg(wire)
    assert (back.object, back.model_class, back.names) == (found.object, name, found.names)
    assert back.flat.tobytes() == found.canonical().flat.tobytes()
    np.testing.assert_array_equal(wire.mean, found.mean())
    np.testing.assert_array_equal(wire.sd, found.sd())
    assert wire.draws == 80 and np.isnan(back.log_evidence) and back.heldout_rmse == 0.01
    assert back.notes == ("vague",)


def test_many_models_are_one_message() -> None:
    found = [posterior(name) for name in MODEL_CLASSES]
    wire = deserialize_message(serialize_message(models_to_msg(found, STAMP)), ObjectModels)
    assert wire.header.stamp == STAMP and wire.header.frame_id == "world"
    assert list(models_from_msg(wire)) == [entry.object for entry in found]


def broken(**fields: object) -> ObjectModel:
    message = posterior_to_msg(posterior("wheel"))
    for field, value in fields.items():
        setattr(message, field, value)
    return message


BAD = {
    "short": ({"samples": [1.0, 2.0]}, "80 draws of 6"),
    "draws": ({"draws": 81}, "81 draws of 6"),
    "units": ({"units": ["kg", "m", "m", "deg", "1", "1"]}, "expected units kg, m, m, rad"),
    "name": ({"parameters": ["mas", "wheel_x", "wheel_y", "wheel_theta", "mu_x", "mu_y"]}, "did you mean 'mass'"),
    "class": ({"model_class": "weel"}, "did you mean 'wheel'"),
    "nan": ({"samples": [float("nan")] * 480}, "finite draws"),
    "empty": ({"samples": [], "draws": 0}, "expected draws"),
}


@pytest.mark.parametrize(("fields", "what"), BAD.values(), ids=BAD.keys())
def test_malformed_messages_are_refused(fields: dict[str, object], what: str) -> None:
    with pytest.raises(ModelError, match=what):
        posterior_from_msg(broken(**fields))


def points(marker: Marker) -> NDArray[np.float64]:
    return np.array([[point.x, point.y] for point in marker.points])


def test_wheel_is_drawn_where_it_is_in_the_world() -> None:
    pose = np.array([2.0, 1.0, np.pi / 2])
    drawn = deserialize_message(serialize_message(model_markers(posterior("wheel", 1e-6), pose, STAMP)), MarkerArray)
    assert {marker.header.frame_id for marker in drawn.markers} == {"world"}
    assert len({(marker.ns, marker.id) for marker in drawn.markers}) == len(drawn.markers)
    kinds = {marker.type: marker for marker in drawn.markers}
    np.testing.assert_allclose(points(kinds[Marker.POINTS]), [[1.7, 1.3]] * 80, atol=1e-4)
    arrow = points(kinds[Marker.ARROW])
    np.testing.assert_allclose(arrow[0], [1.7, 1.3], atol=1e-4)
    assert "mu_x" in kinds[Marker.TEXT_VIEW_FACING].text


def test_hinge_is_drawn_with_its_circle_and_a_free_body_with_its_mass() -> None:
    drawn = model_markers(posterior("hinge", 1e-6), np.zeros(3), STAMP)
    circle = next(points(marker) for marker in drawn.markers if marker.type == Marker.LINE_STRIP)
    np.testing.assert_allclose(np.hypot(*(circle - 0.3).T), 0.3, atol=1e-4)
    (caption,) = model_markers(posterior("free"), np.zeros(3), STAMP).markers
    assert "mass 0.3" in caption.text and "kg" in caption.text
