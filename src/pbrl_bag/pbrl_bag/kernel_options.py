"""How compiled functions are compiled that others call in loops, and how the threads of a loop on all cores wait."""

from __future__ import annotations

import os
from typing import Any

os.environ.setdefault("OMP_WAIT_POLICY", "passive")
"""OpenMP, which runs such loops, reads it as the first of them is compiled: hence here, which all of them import.

By its own default a thread spins until the next loop begins. That keeps its core from whoever else has something to do:
two fits at once took half as long again as they do with this, and a node that learns took time from one that controls.
"""

LEAF: dict[str, Any] = {"cache": True, "error_model": "numpy", "_nrt": False}
"""Of a function that neither makes nor returns an array.

Numba counts who holds an array, by an atomic addition wherever a function takes one and another where it ends. In small
functions that costs more than their work: a step of a free body took 380 ns with it and takes 38 ns without. A leaf
borrows what it is given. One that made an array would not compile; one that returned an array, or a part of one, would
hand out memory that its owner may free, so none does.
"""
