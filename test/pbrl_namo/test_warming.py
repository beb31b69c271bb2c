"""Compiling ahead: after it the kernels of manipulation are there, and nothing more is compiled for a plan."""

from __future__ import annotations

from pbrl_model.engines.contact_kernel import contact_parallel, contact_serial
from pbrl_namo.manipulation.effort_kernel import efforts
from pbrl_namo.manipulation.rollout_kernel import roll
from pbrl_namo.manipulation.stance_kernel import nearer_than
from pbrl_namo.warming import compile_kernels

KERNELS = (efforts, roll, nearer_than, contact_serial, contact_parallel)


def test_it_compiles_the_kernels_of_manipulation() -> None:
    compile_kernels()
    known = [len(kernel.signatures) for kernel in KERNELS]
    assert min(known) >= 1
    compile_kernels()
    assert [len(kernel.signatures) for kernel in KERNELS] == known
