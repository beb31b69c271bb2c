"""Chipmunk's C functions as compiled code may call them: no Python between one step and the next.

pymunk ships Chipmunk with its functions in reach of cffi. Their addresses are made known to the compiler under their
own names, so that compiled callers can be kept on disk and linked anew in each process.

Pointers are whole numbers of 64 bits here. A vector by value, `cpVect`, is two doubles in registers, which is how
the C calling conventions of x86-64 and arm64 (Linux, macOS) pass a structure of two doubles; one that comes back is
a pair. `test_contact_world.py` holds what comes of it to
pymunk's own calls.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import llvmlite.binding
import numpy as np
from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic
from numba.np.numpy_support import carray
from pymunk._chipmunk_cffi import ffi, lib

_types: Any = types  # not all of it is typed
_POINTER, _REAL, _WHOLE, _NONE = types.intp, types.float64, types.int32, types.void
_PAIR = _types.UniTuple(types.float64, 2)


def _make_known(name: str) -> None:
    llvmlite.binding.add_symbol(name, int(ffi.cast("intptr_t", ffi.addressof(lib, name))))


def _chipmunk(name: str, result: Any, *arguments: Any) -> Any:
    _make_known(name)
    return types.ExternalFunction(name, result(*arguments))


def _call_for_vector(name: str) -> Any:
    """Return the code generator of a call that returns a vector, which `types.ExternalFunction` cannot."""
    _make_known(name)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pair = ir.LiteralStructType([ir.DoubleType(), ir.DoubleType()])
        kind = ir.FunctionType(pair, [argument.type for argument in arguments])
        function = builder.module.globals.get(name) or ir.Function(builder.module, kind, name)
        vector = builder.call(function, arguments)
        return context.make_tuple(builder, _PAIR, [builder.extract_value(vector, k) for k in range(2)])

    return generate


def _vector_of(name: str) -> Any:
    generate = _call_for_vector(name)

    def call(typing: Any, body: Any) -> Any:
        return _PAIR(_POINTER), generate

    return intrinsic(call)


def _vector_at(name: str) -> Any:
    generate = _call_for_vector(name)

    def call(typing: Any, body: Any, x: Any, y: Any) -> Any:
        return _PAIR(_POINTER, _REAL, _REAL), generate

    return intrinsic(call)


space_new = _chipmunk("cpSpaceNew", _POINTER)
space_free = _chipmunk("cpSpaceFree", _NONE, _POINTER)
space_set_iterations = _chipmunk("cpSpaceSetIterations", _NONE, _POINTER, _WHOLE)
space_set_collision_slop = _chipmunk("cpSpaceSetCollisionSlop", _NONE, _POINTER, _REAL)
space_static_body = _chipmunk("cpSpaceGetStaticBody", _POINTER, _POINTER)
space_add_body = _chipmunk("cpSpaceAddBody", _POINTER, _POINTER, _POINTER)
space_add_shape = _chipmunk("cpSpaceAddShape", _POINTER, _POINTER, _POINTER)
space_add_constraint = _chipmunk("cpSpaceAddConstraint", _POINTER, _POINTER, _POINTER)
space_step = _chipmunk("cpSpaceStep", _NONE, _POINTER, _REAL)

body_position = _vector_of("cpBodyGetPosition")
body_velocity = _vector_of("cpBodyGetVelocity")
body_local_to_world = _vector_at("cpBodyLocalToWorld")
body_new = _chipmunk("cpBodyNew", _POINTER, _REAL, _REAL)
body_free = _chipmunk("cpBodyFree", _NONE, _POINTER)
body_angle = _chipmunk("cpBodyGetAngle", _REAL, _POINTER)
body_angular_velocity = _chipmunk("cpBodyGetAngularVelocity", _REAL, _POINTER)
body_set_position = _chipmunk("cpBodySetPosition", _NONE, _POINTER, _REAL, _REAL)
body_set_angle = _chipmunk("cpBodySetAngle", _NONE, _POINTER, _REAL)
body_set_velocity = _chipmunk("cpBodySetVelocity", _NONE, _POINTER, _REAL, _REAL)
body_set_angular_velocity = _chipmunk("cpBodySetAngularVelocity", _NONE, _POINTER, _REAL)
body_set_force = _chipmunk("cpBodySetForce", _NONE, _POINTER, _REAL, _REAL)
body_set_torque = _chipmunk("cpBodySetTorque", _NONE, _POINTER, _REAL)

polygon_new = _chipmunk("cpPolyShapeNewRaw", _POINTER, _POINTER, _WHOLE, _POINTER, _REAL)
segment_new = _chipmunk("cpSegmentShapeNew", _POINTER, _POINTER, _REAL, _REAL, _REAL, _REAL, _REAL)
shape_set_elasticity = _chipmunk("cpShapeSetElasticity", _NONE, _POINTER, _REAL)
shape_set_friction = _chipmunk("cpShapeSetFriction", _NONE, _POINTER, _REAL)
shape_free = _chipmunk("cpShapeFree", _NONE, _POINTER)

pin_new = _chipmunk("cpPinJointNew", _POINTER, _POINTER, _POINTER, _REAL, _REAL, _REAL, _REAL)
pin_set_anchor_a = _chipmunk("cpPinJointSetAnchorA", _NONE, _POINTER, _REAL, _REAL)
pin_set_distance = _chipmunk("cpPinJointSetDist", _NONE, _POINTER, _REAL)
pivot_new = _chipmunk("cpPivotJointNew2", _POINTER, _POINTER, _POINTER, _REAL, _REAL, _REAL, _REAL)
constraint_body_b = _chipmunk("cpConstraintGetBodyB", _POINTER, _POINTER)
constraint_set_max_bias = _chipmunk("cpConstraintSetMaxBias", _NONE, _POINTER, _REAL)
constraint_set_max_force = _chipmunk("cpConstraintSetMaxForce", _NONE, _POINTER, _REAL)
constraint_set_before_solve = _chipmunk("cpConstraintSetPreSolveFunc", _NONE, _POINTER, _POINTER)
constraint_set_data = _chipmunk("cpConstraintSetUserData", _NONE, _POINTER, _POINTER)
constraint_data = _chipmunk("cpConstraintGetUserData", types.voidptr, _POINTER)
constraint_free = _chipmunk("cpConstraintFree", _NONE, _POINTER)


def _realign(joint: int, space: int) -> None:
    """Carry the far end of a wheel's joint along with the body, before every solve.

    Chipmunk calls this. The joint's data is where the two coordinates of the far end in the body's axes stand.
    """
    far_end = carray(constraint_data(joint), (2,), np.float64)
    x, y = body_local_to_world(constraint_body_b(joint), far_end[0], far_end[1])
    pin_set_anchor_a(joint, x, y)


@cache
def _compiled() -> Any:
    """Compile `_realign` when it is first needed, and keep it while the process lives: Chipmunk holds its address."""
    return cfunc(types.void(types.intp, types.intp), cache=True)(_realign)


def realign_address() -> int:
    """Return where Chipmunk finds `_realign`."""
    return int(_compiled().address)
