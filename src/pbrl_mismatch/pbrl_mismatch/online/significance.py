"""When a mismatch is significant: the batch test of a published model on everything that was heard up to a moment.

The watch is judged by it. It is the test of a diagnosis (`search.predictive`), with the model that was published as
what is believed beforehand, and it may be asked of any recording.
"""

from __future__ import annotations

import numpy as np

from pbrl_bag.types import Recording
from pbrl_mismatch.data.cuts import cut_windows
from pbrl_mismatch.data.track import lay_track
from pbrl_mismatch.online.options import MonitorOptions
from pbrl_mismatch.online.reading import readings_of
from pbrl_mismatch.online.second_look import nearest_draws
from pbrl_mismatch.online.slices import between
from pbrl_mismatch.search.climb import climb
from pbrl_mismatch.search.objective import Objective
from pbrl_mismatch.search.predictive import predictive_test
from pbrl_model.fitting.episodes import body_of, motions_of
from pbrl_model.posterior import Posterior

WINDOW = 2.0
"""Length of a window [s]: the longest of a diagnosis."""
ITERATIONS = 8


def promised_level(options: MonitorOptions) -> float:
    """Return the level at which a batch test, done anew at every hop, would keep the watch's promise (Bonferroni)."""
    return options.false_alarm * options.hop / options.horizon


def batch_p_value(recording: Recording, posterior: Posterior, until: float, options: MonitorOptions) -> float:
    """Return the p-value of the batch test on what was heard by a moment: that of the reading that does best.

    Each is climbed from its mean and, as in a second look, from the draws that come nearest to what was heard.

    Args:
        recording: from its beginning on.
        posterior: of one object.
        until: the moment [s].
        options: of the watch.

    Raises:
        ModelError: the object has not been held for long enough by then, or a stream is missing or broken.
        BagError: nothing was seen or felt of a hold yet.
    """
    heard = between(recording, -float("inf"), until)
    motions = motions_of(heard, posterior.object)
    geometry = heard.bodies[posterior.object]
    track = lay_track(heard, motions, geometry, body_of(geometry, motions[0].oriented))
    cuts = cut_windows(track, WINDOW)
    found = []
    for reading in readings_of(posterior):
        starts = [reading.mean, *(near.mean for near in nearest_draws(reading, (cuts,), options))]
        objective = Objective(reading.hypothesis, cuts, options.sensor_floor)
        peak = climb(objective, np.array(starts), iterations=ITERATIONS)
        found += [predictive_test(peak, row).p_value for row in range(len(starts))]
    return max(found)
