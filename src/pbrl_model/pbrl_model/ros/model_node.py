"""Learns object models as data come in, and when asked, and publishes them with samples; keeps them on disk."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from pbrl_msgs.msg import ObjectModels
from pbrl_msgs.srv import LearnModel
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from visualization_msgs.msg import MarkerArray

from pbrl_bag import read_recording
from pbrl_bag.decoding import PoseSample, poses_in
from pbrl_bag.errors import BagError
from pbrl_bag.ros.diagnostics import Diagnostics
from pbrl_bag.ros.parameters import declare, refuse_unknown
from pbrl_bag.ros.running import run_node
from pbrl_bag.ros.stopping import ended_by_signals
from pbrl_bag.types import BodyGeometry, Recording
from pbrl_model.errors import ModelError
from pbrl_model.fitting.fit import Fit, FitOptions, ObjectFit, fit_recording
from pbrl_model.online.learner import OnlineLearner, OnlineOptions, adopted
from pbrl_model.online.state import Stored, load_all, prepare, save
from pbrl_model.parameters import MODEL_CLASSES
from pbrl_model.posterior import Posterior
from pbrl_model.prior_options import PriorOptions, load_prior_options
from pbrl_model.ros.conversions import models_to_msg
from pbrl_model.ros.listener import MEMORY, RecordingListener
from pbrl_model.ros.markers import model_markers
from pbrl_model.ros.online_worker import OnlineWorker
from pbrl_model.told_models import ToldModel, told_models

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
MARKER_SECONDS = 0.5
LAST = float(2**31 - 1)
"""Latest time that a stamp can say [s]; a file may tell of any."""


class ModelNode(Node):
    """Offers `/learn`; publishes `/object_models` and `/object_models/markers`.

    With `online`, posteriors go on from window to window while something is held, and what is known is published at
    least every `period` as long as data come. With `state`, what is known is kept in files and served after a restart.
    What `models` say is published until something has been learned of the object.

    Raises:
        BagError: a wrong parameter.
        ModelError: the file of priors, of a model or of the state is not usable.
    """

    def __init__(self, context: Context | None = None, **options: Any):
        super().__init__("model_node", context=context, **options)
        draws = "draws published for each object"
        self._max_draws: int = declare(self, "max_draws", 1000, draws, (1, 100_000))
        priors = declare(self, "priors", "", "YAML file of priors, as config/params/priors.yaml; empty: its defaults")
        online = declare(self, "online", True, "whether to learn while something is held, without being asked")
        text = "what is learned online; as /learn's model_class"
        model_class = declare(self, "model_class", "wheel+ground", text, choices=MODEL_CLASSES)
        particles = declare(self, "particles", 300, "particles of each object that is learned online", (50, 100_000))
        period = declare(self, "period", 0.5, "time between two publications while data come [s]", (0.05, 1.0))
        state = declare(self, "state", "", "folder that keeps what was learned, one file an object; empty: nothing")
        text = "files, one an object: posterior_NAME.nc or model_NAME.json; published until more is learned of it"
        models = declare(self, "models", [], text)
        memory = declare(self, "memory", MEMORY, "most that is kept of messages for /learn [MB]", (1.0, 100_000.0))
        refuse_unknown(self)
        self._priors = load_prior_options(Path(priors)) if priors else PriorOptions()
        fit = FitOptions(model_class=model_class, priors=self._priors)
        self._options = OnlineOptions(fit=fit, particles=particles)
        self._folder = Path(state) if state else None
        told, stored = told_models([Path(each) for each in models]), self._stored()
        self._posteriors: dict[str, Posterior] = {}
        self._lock = threading.Lock()
        self._stamp = 0.0
        self._published = 0
        self._worker: OnlineWorker | None = None
        self._models = self.create_publisher(ObjectModels, "object_models", LATCHED)
        self._markers = self.create_publisher(MarkerArray, "object_models/markers", QoSProfile(depth=1))
        self.listener = RecordingListener(f"{self.get_name()}_listener", context, memory, self.get_namespace())
        # In the listener's thread, as this node's own is busy while it answers /learn.
        self.listener.tell(Diagnostics(self, self._doing, numbers=self._numbers, runs_in=self.listener))
        self.create_service(LearnModel, "learn", self._learn)
        self.create_timer(MARKER_SECONDS, self._draw, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self._tell(told, stored)
        if online:
            self._worker = self._start_learning(stored, period)
        self.listener.start()

    def _doing(self) -> str:
        known = ", ".join(self._posteriors) or "nothing yet"
        return f"{'learns as it hears' if self._worker is not None else 'learns when asked'}; knows {known}"

    def _numbers(self) -> dict[str, object]:
        return {
            "objects": len(self._posteriors),
            "messages heard": self.listener.count(),
            "learned up to [s]": self._stamp,
        }

    def _stored(self) -> dict[str, Stored]:
        """Return what is on disk."""
        if self._folder is None:
            return {}
        prepare(self._folder)
        return load_all(self._folder)

    def _tell(self, told: Mapping[str, ToldModel], stored: Mapping[str, Stored]) -> None:
        """Publish what is known before anything is heard; what this node learned itself goes before what files say."""
        posteriors = {name: one.posterior for name, one in told.items()}
        posteriors |= {name: one.posterior for name, one in stored.items()}
        if not posteriors:
            return
        ends = [float(motion.time[-1]) for one in stored.values() for motion in one.learned.motions]
        self._changed(posteriors, max([one.until for one in told.values()] + ends, default=0.0))
        log = self.get_logger()
        log.info(f"known already: {', '.join(posteriors)}")
        for name, one in told.items():
            if name in stored:
                log.warning(f"{name}: known from what was learned (state), so that {one.path} is not used (models)")
            elif one.left_out:
                log.warning(f"{one.path}: {one.posterior.notes[-1]}")
        given = self._options.fit
        for name, one in stored.items():
            if one.fit.model_class != given.model_class or one.fit.priors != given.priors:
                log.warning(
                    f"{name}: goes on with the model class ({one.fit.model_class}) and the priors that it was learned "
                    "with, not with those given now; to begin anew, move its file away (state)"
                )

    def _start_learning(self, stored: Mapping[str, Stored], period: float) -> OnlineWorker:
        learner = OnlineLearner(self._options)
        for one in stored.values():
            learner.resume(one.learned, one.posterior, one.fit)
        warn = self.get_logger().warning
        worker = OnlineWorker(learner, self.listener, self._folder, self._changed, warn, period)
        # In the listener's thread: this node's own is busy while it answers /learn.
        self.listener.create_timer(period, self._publish_if_heard, clock=Clock(clock_type=ClockType.STEADY_TIME))
        worker.start()
        return worker

    def _changed(self, posteriors: Mapping[str, Posterior], last_used: float) -> None:
        """Publish what has been learned anew, with the rest; last_used is the end of the data [s]."""
        with self._lock:
            thinned = {
                name: one.thinned(self._max_draws, np.random.default_rng(self._options.fit.seed))
                for name, one in posteriors.items()
            }
            self._posteriors = self._posteriors | thinned
            self._stamp = last_used
        self._publish()

    def _publish(self) -> None:
        with self._lock:
            self._models.publish(models_to_msg(self._posteriors.values(), _stamp(self._stamp)))

    def _publish_if_heard(self) -> None:
        """Publish what is known, if anything was heard since the last time."""
        heard = self.listener.count()
        if heard != self._published and self._posteriors:
            self._published = heard
            self._publish()

    def _learn(self, request: LearnModel.Request, response: LearnModel.Response) -> LearnModel.Response:
        """Fit, publish and answer; what goes wrong is the answer's message."""
        try:
            with ended_by_signals(), self._learning_paused():  # a fit takes longer than one waits for a node to end
                recording = read_recording(Path(request.recording)) if request.recording else self.listener.recording()
                options = self._fit_options(request)
                found = fit_recording(recording, options)
                response.models = self._take(found, recording, options, heard=not request.recording)
        except (BagError, ModelError) as error:
            response.message = " ".join(str(error).split())
            self.get_logger().warning(f"/learn: {response.message}")
            return response
        except Exception as error:  # a fault of ours must not cost what has been heard
            response.message = f"internal error: {type(error).__name__}: {' '.join(str(error).split())}"
            self.get_logger().error(f"/learn: {response.message}")
            return response
        response.success = True
        response.message = f"learned {', '.join(found.objects)}"
        self.get_logger().info(response.message)
        return response

    @contextmanager
    def _learning_paused(self) -> Iterator[None]:
        if self._worker is None:
            yield
        else:
            with self._worker.paused():
                yield

    def _fit_options(self, request: LearnModel.Request) -> FitOptions:
        return FitOptions(
            model_class=request.model_class or FitOptions.model_fields["model_class"].default,
            objects=tuple(request.objects),
            seed=request.seed,
            priors=self._priors,
        )

    def _take(self, found: Fit, recording: Recording, options: FitOptions, *, heard: bool) -> ObjectModels:
        """Publish what was fitted, keep it, and go on from it; return it as a message."""
        rng = np.random.default_rng(options.seed)
        posteriors = {name: one.posterior.thinned(self._max_draws, rng) for name, one in found.objects.items()}
        end = _end_of(recording)
        self._changed(posteriors, end)
        for name, one in found.objects.items():
            if name in recording.bodies and (self._worker is not None or self._folder is not None):
                self._keep(one, recording.bodies[name], posteriors[name], options, heard=heard)
        return models_to_msg(posteriors.values(), _stamp(end))

    def _keep(
        self, found: ObjectFit, geometry: BodyGeometry, posterior: Posterior, options: FitOptions, *, heard: bool
    ) -> None:
        """Write what was fitted to disk, and go on from it online."""
        stored = Stored(adopted(found, geometry, replace(self._options, fit=options)), posterior, options)
        if self._folder is not None:
            save(self._folder, stored)
        if self._worker is not None:
            self._worker.give(stored, heard=heard)

    def _draw(self) -> None:
        """Publish markers where the objects were last seen."""
        drawn = MarkerArray()
        for posterior in self._posteriors.values():
            topic = f"/ar_tags/{posterior.object}/pose"
            message = self.listener.last(topic)
            with suppress(BagError, AttributeError):  # said where it is learned from
                for seen in poses_in(topic, message, None) if message is not None else ():
                    drawn.markers += model_markers(posterior, _planar(seen), message.header.stamp).markers
        if drawn.markers:
            self._markers.publish(drawn)

    def destroy_node(self) -> None:
        """Stop listening with the node."""
        if self._worker is not None:
            self._worker.stop()
        self.listener.stop()
        super().destroy_node()


def _planar(seen: PoseSample) -> np.ndarray:
    """Return (3,) x, y, theta of a pose that stands upright."""
    x, y, z, w = seen.quaternion
    return np.array([*seen.position[:2], np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))])


def _end_of(recording: Recording) -> float:
    """Return the time of the last sample [s]."""
    streams = [*recording.object_poses.values(), *recording.wrenches.values()]
    return max((float(stream.time[-1]) for stream in streams if stream.time.size), default=0.0)


def _stamp(seconds: float) -> Time:
    seconds = min(max(seconds, 0.0), LAST)
    whole = int(seconds)
    return Time(sec=whole, nanosec=min(int((seconds - whole) * 1e9), 999_999_999))


def main() -> None:
    """Run the node until it is told to stop; errors at start are one line and exit code 2."""
    run_node("model_node", ModelNode, (ModelError,))


if __name__ == "__main__":
    main()
