"""What others learn of things and tell on /object_models: each posterior is believed once, and takes no stop away."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from pbrl_msgs.msg import ObjectModel, Scene

from pbrl_control.errors import ControlError
from pbrl_model.errors import ModelError
from pbrl_namo.beliefs.belief import ObjectBelief
from pbrl_namo.errors import NamoError
from pbrl_namo.executive.jobs import Belief
from pbrl_namo.ros.conversions import belief_from_msg


class ToldModels:
    """Remembers what was told last of each object.

    Learners say all that they know again and again. Taken each time, what was found out here since would be forgotten.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[tuple[str, ...], bytes]] = {}

    def news(
        self,
        models: Iterable[ObjectModel],
        scene: Scene,
        believed: Callable[[str], Belief | None],
        refuse: Callable[[str], object],
    ) -> Iterator[tuple[str, ObjectBelief]]:
        """Yield what is told of an object for the first time, or otherwise than last time: name, belief.

        Args:
            models: as they are told now.
            scene: that tells outlines.
            believed: gives what is believed of an object until now: where it met something stays known.
            refuse: is told in a sentence of models that are none.
        """
        for model in models:
            told = tuple(model.parameters), bytes(model.samples)
            if self._last.get(model.object) == told:
                continue
            try:
                belief = belief_from_msg(model, scene)
            except (ModelError, NamoError, ControlError) as error:
                refuse(f"model of {model.object!r} is left aside: {error}")
                continue
            if belief is None:
                continue
            self._last[model.object] = told
            before = believed(model.object)
            yield model.object, replace(belief, stops=before.stops) if isinstance(before, ObjectBelief) else belief
