"""Compiled: the place for laws that a user adds, called from the kernel through their addresses.

`TABLE` is memory that compiled code finds by its name, `pbrl_own_laws`: how many laws there are, then for each its
address and the column that switches it on. What was compiled without a law, and lies on disk, calls those that are
entered when it runs. Where there is none, a step reads one number.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import NDArray

from pbrl_bag.kernel_options import LEAF

Array = NDArray[np.float64]

_types: Any = types  # not all of it is typed
_cgutils: Any = cgutils
LAWS = 8
"""Laws at most."""
TABLE = np.zeros(1 + 2 * LAWS, dtype=np.int64)
_NAME = "pbrl_own_laws"
llvmlite.binding.add_symbol(_NAME, TABLE.ctypes.data)

SLIGHT = 1e-5
"""Change of a velocity [m/s], [rad/s] by which it is felt how a law answers to it."""

LAW = types.void(*[types.float64] * 7, *[_types.CPointer(types.float64)] * 2)
"""Of a law: time, pose (x, y, theta) and twist (vx, vy, omega) of the body's frame; parameters; wrench, written."""


def _read(typing: Any, place: Any) -> Any:
    """Read a number of the table."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = ir.IntType(64)
        table = builder.module.globals.get(_NAME)
        if table is None:
            table = ir.GlobalVariable(builder.module, ir.ArrayType(whole, len(TABLE)), _NAME)
            table.linkage = "external"
        return builder.load(builder.gep(table, [whole(0), arguments[0]]))

    return types.int64(types.int64), generate


def _ask(
    typing: Any, address: Any, time: Any, x: Any, y: Any, theta: Any, vx: Any, vy: Any, omega: Any, parameters: Any
) -> Any:
    """Return the wrench (fx, fy, tau) of the law at an address, for parameters that begin at another address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = ir.DoubleType()
        kind = ir.FunctionType(ir.VoidType(), [number] * 7 + [number.as_pointer()] * 2)
        law = builder.inttoptr(arguments[0], kind.as_pointer())
        told = builder.inttoptr(arguments[8], number.as_pointer())
        out = _cgutils.alloca_once(builder, ir.ArrayType(number, 3))
        first = builder.gep(out, [ir.IntType(32)(0), ir.IntType(32)(0)])
        builder.call(law, [*arguments[1:8], told, first])
        found = builder.load(out)
        triple = _types.UniTuple(types.float64, 3)
        return context.make_tuple(builder, triple, [builder.extract_value(found, k) for k in range(3)])

    return _types.UniTuple(types.float64, 3)(types.int64, *[types.float64] * 7, types.intp), generate


_entry: Any = intrinsic(_read)
_call: Any = intrinsic(_ask)


@njit(**LEAF, forceinline=True)
def how_many() -> int:
    """Return how many laws there are."""
    return int(_entry(0))


@njit(**LEAF)
def at_centre(
    address: int,
    told: int,
    time: float,
    x: float,
    y: float,
    theta: float,
    rx: float,
    ry: float,
    vx: float,
    vy: float,
    omega: float,
) -> tuple[float, float, float]:
    """Return a law's wrench at the centre of mass, world axes [N, N, N m].

    Args:
        address: of the law.
        told: address of its parameters.
        time: [s].
        x: origin of the body's frame [m].
        y: as `x`.
        theta: [rad].
        rx: lever of the centre of mass from that origin, world axes [m].
        ry: as `rx`.
        vx: velocity of the centre of mass [m/s].
        vy: as `vx`.
        omega: [rad/s].
    """
    fx, fy, tau = _call(address, time, x, y, theta, vx + omega * ry, vy - omega * rx, omega, told)
    return fx, fy, tau - rx * fy + ry * fx


@njit(**LEAF)
def own_laws(p: Array, state: Array, c: float, s: float, time: float, com: Array, acc: Array) -> None:
    """Add what the laws do that are on.

    How a law answers to velocity is felt by small changes, and solved for implicitly where it resists motion: drag is
    steady then at any step, and dry friction that is smooth.

    Args:
        p: (WIDTH,) parameter row.
        state: (STATE,) of the centre of mass.
        c: cosine of the heading.
        s: sine of the heading.
        time: [s].
        com: (2,) centre of mass in the body's frame [m].
        acc: (9,) account, see `account_kernel`.
    """
    rx, ry = c * com[0] - s * com[1], s * com[0] + c * com[1]
    x, y, theta, vx, vy, omega = state[0] - rx, state[1] - ry, state[2], state[3], state[4], state[5]
    for k in range(how_many()):
        address, column = _entry(1 + 2 * k), _entry(2 + 2 * k)
        if not p[column] > 0.0:
            continue
        told = p.ctypes.data + 8 * (column + 1)
        fx, fy, tau = at_centre(address, told, time, x, y, theta, rx, ry, vx, vy, omega)
        ax, ay, at = at_centre(address, told, time, x, y, theta, rx, ry, vx + SLIGHT, vy, omega)
        bx, by, bt = at_centre(address, told, time, x, y, theta, rx, ry, vx, vy + SLIGHT, omega)
        tx, ty, tt = at_centre(address, told, time, x, y, theta, rx, ry, vx, vy, omega + SLIGHT)
        d0, d2, d5 = (fx - ax) / SLIGHT, (fy - by) / SLIGHT, (tau - tt) / SLIGHT
        d1 = 0.5 * (fx - bx + fy - ay) / SLIGHT
        d3 = 0.5 * (fx - tx + tau - at) / SLIGHT
        d4 = 0.5 * (fy - ty + tau - bt) / SLIGHT
        acc[0] += fx
        acc[1] += fy
        acc[2] += tau
        minor = d0 * d2 - d1 * d1
        whole = d0 * (d2 * d5 - d4 * d4) - d1 * (d1 * d5 - d4 * d3) + d3 * (d1 * d4 - d2 * d3)
        least = -1e-9 * (d0 + d2) ** 2
        if d0 >= 0.0 and d2 >= 0.0 and d5 >= 0.0 and minor >= least and whole >= least * d5:
            acc[0] += d0 * vx + d1 * vy + d3 * omega
            acc[1] += d1 * vx + d2 * vy + d4 * omega
            acc[2] += d3 * vx + d4 * vy + d5 * omega
            acc[3] += d0
            acc[4] += d1
            acc[5] += d2
            acc[6] += d3
            acc[7] += d4
            acc[8] += d5
