"""Local control of a robot that pushes a cart with both hands (thesis 4.5.5, 4.5.6, equations 12 to 14)."""

from pbrl_control.cart.arms import ArmRates, ArmState, hand_twists, pseudo_inverse_rates, transpose_rates
from pbrl_control.cart.body import CartBody
from pbrl_control.cart.controller import CartController
from pbrl_control.cart.percept import CartCommand, CartPercept, Cause, CostWindow, DriveStatus
from pbrl_control.cart.plan import CartPlan
from pbrl_control.cart.prepare import compile_kernels
from pbrl_control.cart.settings import CartLimits, CartSettings
from pbrl_control.cart.sight import CartSight, choose_sight

__all__ = [
    "ArmRates",
    "ArmState",
    "CartBody",
    "CartCommand",
    "CartController",
    "CartLimits",
    "CartPercept",
    "CartPlan",
    "CartSettings",
    "CartSight",
    "Cause",
    "CostWindow",
    "DriveStatus",
    "choose_sight",
    "compile_kernels",
    "hand_twists",
    "pseudo_inverse_rates",
    "transpose_rates",
]
