"""Learns object models when asked, from what it has heard or from a recording, and publishes them with samples."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from pbrl_msgs.msg import ObjectModels
from pbrl_msgs.srv import LearnModel
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import MarkerArray

from pbrl_bag import read_recording
from pbrl_bag.errors import BagError
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.stopping import ended_by_signals, init_until_signal, spin_until
from pbrl_bag.types import Recording
from pbrl_model.errors import ModelError
from pbrl_model.fit import FitOptions, fit_recording
from pbrl_model.posterior import Posterior
from pbrl_model.prior_options import PriorOptions, load_prior_options
from pbrl_model.ros.conversions import models_to_msg
from pbrl_model.ros.listener import RecordingListener
from pbrl_model.ros.markers import model_markers

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MARKER_SECONDS = 0.5


class ModelNode(Node):
    """Offers `/learn`; publishes `/object_models` and `/object_models/markers`.

    Raises:
        BagError: a wrong parameter.
        ModelError: the file of priors is not usable.
    """

    def __init__(self, context: Context | None = None, **options: Any):
        super().__init__("model_node", context=context, **options)
        draws = "draws published for each object"
        self._max_draws: int = declare(self, "max_draws", 1000, draws, (1, 100_000))
        priors = declare(self, "priors", "", "YAML file of priors, as config/params/priors.yaml; empty: its defaults")
        refuse_unknown(self)
        self._priors = load_prior_options(Path(priors)) if priors else PriorOptions()
        self._posteriors: dict[str, Posterior] = {}
        self._models = self.create_publisher(ObjectModels, "/object_models", LATCHED)
        self._markers = self.create_publisher(MarkerArray, "/object_models/markers", QoSProfile(depth=1))
        self.listener = RecordingListener("model_node_listener", context)
        self.listener.start()
        self.create_service(LearnModel, "/learn", self._learn)
        self.create_timer(MARKER_SECONDS, self._draw, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _learn(self, request: LearnModel.Request, response: LearnModel.Response) -> LearnModel.Response:
        """Fit, publish and answer; what goes wrong is the answer's message."""
        try:
            with ended_by_signals():  # a fit takes longer than one waits for a node to end
                recording = read_recording(Path(request.recording)) if request.recording else self.listener.recording()
                learned = self._fit(recording, request)
        except (BagError, ModelError) as error:
            response.message = " ".join(str(error).split())
            self.get_logger().warning(f"/learn: {response.message}")
            return response
        except Exception as error:  # a fault of ours must not cost what has been heard
            response.message = f"internal error: {type(error).__name__}: {' '.join(str(error).split())}"
            self.get_logger().error(f"/learn: {response.message}")
            return response
        rng = np.random.default_rng(request.seed)
        self._posteriors |= {posterior.object: posterior.thinned(self._max_draws, rng) for posterior in learned}
        stamp = _stamp(_end_of(recording))
        response.models = models_to_msg([self._posteriors[posterior.object] for posterior in learned], stamp)
        self._models.publish(models_to_msg(self._posteriors.values(), stamp))
        response.success = True
        response.message = f"learned {', '.join(posterior.object for posterior in learned)}"
        self.get_logger().info(response.message)
        return response

    def _fit(self, recording: Recording, request: LearnModel.Request) -> list[Posterior]:
        options = FitOptions(
            model_class=request.model_class or FitOptions.model_fields["model_class"].default,
            objects=tuple(request.objects),
            seed=request.seed,
            priors=self._priors,
        )
        return [found.posterior for found in fit_recording(recording, options).objects.values()]

    def _draw(self) -> None:
        """Publish markers where the objects were last seen."""
        drawn = MarkerArray()
        for posterior in self._posteriors.values():
            seen: PoseStamped | None = self.listener.last(f"/ar_tags/{posterior.object}/pose")
            if seen is not None:
                drawn.markers += model_markers(posterior, _planar(seen), seen.header.stamp).markers
        if drawn.markers:
            self._markers.publish(drawn)

    def destroy_node(self) -> None:
        """Stop listening with the node."""
        self.listener.stop()
        super().destroy_node()


def _planar(seen: PoseStamped) -> np.ndarray:
    """Return (3,) x, y, theta of a pose that stands upright."""
    position, q = seen.pose.position, seen.pose.orientation
    theta = np.arctan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    return np.array([position.x, position.y, theta])


def _end_of(recording: Recording) -> float:
    """Return the time of the last sample [s]."""
    streams = [*recording.object_poses.values(), *recording.wrenches.values()]
    return max((float(stream.time[-1]) for stream in streams if stream.time.size), default=0.0)


def _stamp(seconds: float) -> Time:
    whole = int(np.floor(seconds))
    return Time(sec=whole, nanosec=min(int((seconds - whole) * 1e9), 999_999_999))


def main() -> None:
    """Run the node; errors at start are one line and exit code 2."""
    node = None
    fault = ""
    try:
        stop = init_until_signal()
        node = ModelNode()
        spin_until(node, stop.is_set)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (BagError, ModelError) as error:
        fault = " ".join(str(error).split())
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    if fault:
        print(f"model_node: {fault}", file=sys.stderr)
        sys.exit(2)


if __name__ == "__main__":
    main()
