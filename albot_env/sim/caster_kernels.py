"""Compiled caster: where the wheel that trails behind the axle points to.

The wheel's point of contact moves only where the wheel points. With the caster's pivot a
length L behind the axle, its wheel a length c behind the pivot, and the robot driving at v
and turning at ω, the caster's angle ψ (rad, counter-clockwise, 0 as it trails when the
robot drives on) obeys

    ψ' = -(v sin ψ + ω L cos ψ) / c - ω

(Campion, Bastin and D'Andréa-Novel, Structural properties and classification of kinematic
and dynamic models of wheeled mobile robots, IEEE Trans. Robotics and Automation 12(1),
1996: the constraint of a castor wheel). When the robot reverses, it swings right round.
"""

from __future__ import annotations

import math

from albot_core.kernels.compiled import kernel

PIVOT = 0.2
"""L: distance of the pivot behind the axle (m); nominal, as of a Pioneer 3-DX."""
TRAIL = 0.03
"""c: distance of the wheel behind the pivot (m); nominal."""
_SKEW = math.radians(1.0)
"""A caster does not trail quite straight, so that reversing straight on it does not balance."""
_STRIDE = 0.2
"""The equation is solved in steps of at most this angle (rad)."""


@kernel()
def swing(angle: float, distance: float, turn: float) -> float:
    """The caster's angle after the robot drives so far (m) while it turns so much (rad)."""
    strides = math.ceil((abs(distance) / TRAIL + abs(turn) * (1 + PIVOT / TRAIL)) / _STRIDE)
    for _ in range(strides):
        step = _rate(angle, distance, turn) / strides
        angle += _rate(angle + step / 2, distance, turn) / strides
    return angle


@kernel()
def _rate(angle: float, distance: float, turn: float) -> float:
    """How fast the caster swings, as the whole motion takes one unit of time."""
    along = distance * math.sin(angle - math.copysign(_SKEW, distance))
    return -(along + turn * PIVOT * math.cos(angle)) / TRAIL - turn
