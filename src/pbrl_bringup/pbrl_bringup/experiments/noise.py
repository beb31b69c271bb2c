"""Thesis figure 26: accuracy against training size at sigma^2 = 0.50, and against noise with 50 samples; shopping cart.

Physics-based learning (PBR), locally weighted regression (LWR) and linear regression (LR) learn from the same noisy
transitions and are scored by R^2 on 200 transitions without noise (`accuracy.r_squared`). Noise is in centimetres and
centimetres a second, angles by the radius of gyration, as in figure 24; see `sample_efficiency`. In one repetition the
sizes are the first rows of one data set, and the noises are multiples of one draw: curves differ by what is studied.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pbrl_bringup.benches.rows import Measured, Row, at_least
from pbrl_bringup.experiments.accuracy import (
    COLOURS,
    METHODS,
    NOISE_UNIT,
    learn_linear,
    learn_local,
    learn_physics,
    predicted,
    r_squared,
    training_and_test,
)
from pbrl_bringup.experiments.figures import band, canvas, save
from pbrl_bringup.experiments.household import load_household
from pbrl_bringup.parallel import in_parallel
from pbrl_model.transitions.data import BodyTransitions

Array = NDArray[np.float64]

CART = "shopping_cart"
SIGMA = 0.50**0.5  # [cm]
SIZES = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 100, 200)
SAMPLES = 50
NOISES = (0.0, 0.1, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0)  # [cm]
QUICK_SIZES = (2, 5, 10, 20, 50)
QUICK_NOISES = (0.0, 0.5, 1.0, 2.0)
REPETITIONS = {False: 20, True: 2}
LEAST, MOST = 1e-6, 10.0
"""Of 1 - R^2, what is drawn: less is as good as nothing, and above one the mean predicts better."""
THESIS = {
    "a": "PBR drops rapidly to no error; LR is sharp and levels off below 1; LWR converges to 1, more slowly",
    "b": "PBR is the most robust; LR misses 1 even without noise; LWR reaches 1 without noise and falls off quickly",
}


def measure(seed: int, quick: bool, out: Path) -> Measured:
    """Score the three learners over training sizes and over noises, and draw both panels."""
    sizes, noises = (QUICK_SIZES, QUICK_NOISES) if quick else (SIZES, NOISES)
    repetitions = REPETITIONS[quick]
    scores = in_parallel(trial, [(seed, k, sizes, noises) for k in range(repetitions)], "repetitions")
    by_size = np.array([each[0] for each in scores]).transpose(1, 2, 0)
    by_noise = np.array([each[1] for each in scores]).transpose(1, 2, 0)
    save(_figure(sizes, by_size, noises, by_noise), out)
    details = {
        "thesis": THESIS,
        "repetitions": repetitions,
        "against size": _table("observations", sizes, by_size),
        "against noise": _table("sigma [cm]", noises, by_noise),
    }
    return Measured(
        [
            *_rows(by_size, f"training sizes at sigma^2 = 0.50 cm^2 ({sizes[0]} to {sizes[-1]})"),
            *_rows(by_noise, f"noises with {SAMPLES} samples ({noises[0]:g} to {noises[-1]:g} cm)"),
            *_without_noise(by_noise[0]),
        ],
        details,
    )


def trial(seed: int, repetition: int, sizes: tuple[int, ...], noises: tuple[float, ...]) -> tuple[Array, Array]:
    """Return the scores of one repetition: (sizes, methods) and (noises, methods)."""
    thing = load_household()[CART]

    def drawn(part: int, n: int, sigma: float) -> tuple[BodyTransitions, BodyTransitions]:
        rng = np.random.default_rng([seed, part, repetition])
        return training_and_test(rng, thing, n, sigma * NOISE_UNIT)

    def score(rng: np.random.Generator, data: BodyTransitions, test: BodyTransitions) -> list[float]:
        posterior = learn_physics(rng, data, thing.geometry)
        return [
            r_squared(test, predicted(posterior, test)),
            r_squared(test, learn_local(data)(test)),
            r_squared(test, learn_linear(data)(test)),
        ]

    rng = np.random.default_rng([seed, 2, repetition])
    data, test = drawn(0, sizes[-1], SIGMA)
    by_size = np.array([score(rng, data.first(n), test) for n in sizes])
    by_noise = np.array([score(rng, *drawn(1, SAMPLES, sigma)) for sigma in noises])
    return by_size, by_noise


def _rows(scores: Array, over: str) -> list[Row]:
    """Judge the share of points (points, methods, repetitions) at which PBR's median is at least the others'."""
    middle = np.median(scores, axis=2)
    ahead = float(np.mean(middle[:, 0] >= middle[:, 1:].max(axis=1)))
    single = float(np.mean(scores[:, 0] >= scores[:, 1:].max(axis=1)))
    return [
        at_least(
            f"share of {over} at which PBR's median R^2 is at least LWR's and LR's",
            ahead,
            "1",
            1.0,
            single_runs=single,
            LWR_best=float(middle[:, 1].max()),
            LR_best=float(middle[:, 2].max()),
            thesis="PBR above both",
        )
    ]


def _without_noise(scores: Array) -> list[Row]:
    """Judge what is left of PBR's error without noise (methods, repetitions); the thesis's inset shows LR's."""
    physics, local, linear = np.median(scores, axis=1)
    what = f"R^2 without noise, {SAMPLES} samples, PBR's median"
    return [at_least(what, physics, "1", 0.9999, LWR=local, LR=linear, thesis="PBR and LWR 1, LR below")]


def _table(name: str, points: tuple[float, ...], scores: Array) -> list[dict[str, float | list[float]]]:
    """Return quartiles by method at every point."""
    quartiles = np.quantile(scores, [0.25, 0.5, 0.75], axis=2)
    return [
        {name: point, **{method: quartiles[:, row, column].tolist() for column, method in enumerate(METHODS)}}
        for row, point in enumerate(points)
    ]


def _figure(sizes: tuple[int, ...], by_size: Array, noises: tuple[float, ...], by_noise: Array) -> Figure:
    """Draw both panels as what is missing to R^2 = 1, on a logarithmic scale: the plateaus are near one."""
    figure, (left, right) = canvas(2, 11.0, 4.9)
    for column, method in enumerate(METHODS):
        band(left, np.array(sizes, dtype=float), _missing(by_size[:, column]), method, COLOURS[method])
        band(right, np.array(noises), _missing(by_noise[:, column]), method, COLOURS[method])
    left.set(xscale="log", ylim=(LEAST / 2.0, 2.0 * MOST), xlabel="training samples")
    left.set_xticks(sizes, [str(n) for n in sizes], fontsize=8)
    left.minorticks_off()
    left.set_title(
        "(a) against training size, $\\sigma^2$ = 0.50 cm$^2$\nthesis: PBR drops rapidly, LR levels off", fontsize=10
    )
    right.set(ylim=(LEAST / 2.0, 1.0), xlabel="noise $\\sigma$ [cm, cm/s]")
    right.set_title(
        f"(b) against noise, {SAMPLES} training samples\nthesis: PBR most robust, LR wrong without noise", fontsize=10
    )
    for axes, x, side in ((left, 0.01, "left"), (right, 1.0, "right")):
        axes.set(yscale="log", ylabel="1 - $R^2$ on 200 samples without noise (less is better)")
        axes.axhline(0.005, color="0.5", linewidth=0.8, linestyle=":")
        axes.annotate("$R^2$ = 0.995", (x, 0.005), xycoords=("axes fraction", "data"), ha=side, va="bottom", fontsize=8)
    right.legend(loc="upper right", frameon=False)
    figure.suptitle(
        f"Figure 26, shopping cart: median, middle half and range of {by_size.shape[2]} repetitions", fontsize=10
    )
    return figure


def _missing(scores: Array) -> Array:
    """Return 1 - R^2, brought into what is drawn."""
    return np.clip(1.0 - scores, LEAST, MOST)
