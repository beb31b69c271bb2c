"""What others learn of things and tell on /object_models: each posterior is believed once, and takes no stop away."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
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
        self._last: dict[str, ObjectBelief] = {}

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
            scene: that tells outlines; one that has changed is news, too.
            believed: gives what is believed of an object until now: where it met something stays known.
            refuse: is told in a sentence of models that are none.
        """
        for model in models:
            try:
                belief = belief_from_msg(model, scene)
            except (ModelError, NamoError, ControlError) as error:
                refuse(f"model of {model.object!r} is left aside: {error}")
                continue
            if belief is None or _same(belief, self._last.get(model.object)):
                continue
            self._last[model.object] = belief
            before = believed(model.object)
            yield model.object, replace(belief, stops=before.stops) if isinstance(before, ObjectBelief) else belief


def _same(belief: ObjectBelief, last: ObjectBelief | None) -> bool:
    """Say whether a belief is of the same draws and the same outline as the last one."""
    return (
        last is not None
        and np.array_equal(belief.rows, last.rows, equal_nan=True)
        and np.array_equal(belief.footprint, last.footprint)
    )
