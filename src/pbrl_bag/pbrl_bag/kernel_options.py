"""How compiled functions are compiled that others call in loops."""

from __future__ import annotations

from typing import Any

LEAF: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
"""Of a function that neither makes nor returns an array.

Numba counts who holds an array, by an atomic addition wherever a function takes one and another where it ends. In small
functions that costs more than their work: a step of a free body took 380 ns with it and takes 38 ns without. A leaf
borrows what it is given. One that made an array would not compile; one that returned an array, or a part of one, would
hand out memory that its owner may free, so none does.
"""
