"""Rubber between plates and edge: an elastic bristle in the plane of the plates that slips, with play if there is any.

The elastic load lies within a limit surface that couples force and moment,

    (|f| / f_max)^2 + (tau / tau_max)^2 <= 1,        f_max = 2 mu F,

beyond which the plates slip: load and deflection stay on the surface and the bristle's root is dragged along the
edge. Plates that are worn or loose have play: within it nothing is felt. Plain floats throughout: it runs in every
physics step, and numpy's arrays would take ten times as long for so few numbers.
"""

from __future__ import annotations

import math

from bullet_sim.clamp import GripperSpec

REFERENCE_MASS = 5.0
"""Mass [kg] for which the rubber's damping ratio is meant: about what an arm shows at its wrist."""


class Bristle:
    """The rubber of one grip, in the axes of the body that is held.

    Attributes:
        root: where the bristle begins, (x, y) [m] in the body's frame.
        turn: relative turn of plates and body at which nothing is twisted [rad].
        slipping: whether the plates slip.
        slipped: way [m] the plates have slid over the edge so far.
    """

    def __init__(self, spec: GripperSpec, depth: float, root: tuple[float, float], turn: float) -> None:
        """Close the plates on `depth` [m] of edge; where they close nothing is stretched."""
        self.root, self.turn = root, turn
        self.slipping, self.slipped = False, 0.0
        self._spec = spec
        self.damping = 2 * spec.damping * math.sqrt(spec.stiffness * REFERENCE_MASS)  # [N s/m]
        self._lever2 = (spec.plate_width**2 + depth**2) / 12  # of a patch that carries evenly [m^2]

    def load(
        self, x: float, y: float, speed: tuple[float, float], turn: float, spin: float
    ) -> tuple[float, float, float]:
        """Give force [N] and torque [N m] on the body in its own axes; slip by moving the bristle's root.

        Args:
            x: of the middle of the plates in the body's frame [m].
            y: as `x`.
            speed: (2,) of the plates against the body [m/s], body axes.
            turn: of the plates against the body [rad].
            spin: rate of that turn [rad/s].
        """
        spec, k, c = self._spec, self._spec.stiffness, self.damping
        stretch_x, stretch_y, twisted = x - self.root[0], y - self.root[1], wrap(turn - self.turn)
        felt_x, felt_y, felt_turn = self._beyond_play(stretch_x, stretch_y, twisted)
        fraction = min(1.0, 1 / max(self._surface(k * felt_x, k * felt_y, k * self._lever2 * felt_turn), 1e-12))
        self.slipping = fraction < 1
        if self.slipping:
            give_x, give_y = (1 - fraction) * felt_x, (1 - fraction) * felt_y
            self.root = self.root[0] + give_x, self.root[1] + give_y
            self.turn += (1 - fraction) * felt_turn
            self.slipped += math.hypot(give_x, give_y)
            felt_x, felt_y, felt_turn = fraction * felt_x, fraction * felt_y, fraction * felt_turn
        if spec.play > 0:  # rubber that does not touch does not rub either
            touching_force, touching_turn = float(felt_x != 0 or felt_y != 0), float(felt_turn != 0)
        else:
            touching_force = touching_turn = 1.0
        force_x = k * felt_x + touching_force * c * speed[0]
        force_y = k * felt_y + touching_force * c * speed[1]
        torque = self._lever2 * (k * felt_turn + touching_turn * c * spin)
        back = max(1.0, self._surface(force_x, force_y, torque))
        return force_x / back, force_y / back, torque / back

    def _beyond_play(self, x: float, y: float, twisted: float) -> tuple[float, float, float]:
        """Give what is left of stretch and twist once the play is taken up."""
        play = self._spec.play
        if play == 0:
            return x, y, twisted
        length, slack = math.hypot(x, y), play / (self._spec.plate_width / 2)
        rest = max(0.0, 1 - play / length) if length > 0 else 0.0
        return rest * x, rest * y, math.copysign(max(0.0, abs(twisted) - slack), twisted)

    def _surface(self, force_x: float, force_y: float, torque: float) -> float:
        """Give how far a load is out on the limit surface: 1 on it, more beyond."""
        limit = self._spec.force_limit
        return math.hypot(force_x / limit, force_y / limit, torque / self._spec.torque_limit)


def wrap(angle: float) -> float:
    """Bring an angle [rad] into [-pi, pi)."""
    return (angle + math.pi) % (2 * math.pi) - math.pi
