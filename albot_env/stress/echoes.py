"""Whether sonars hear what is there: two bounds between which every echo must lie.

A sonar hears a surface that lies in its cone and is not hidden. So its echo is no nearer
than the nearest surface in the cone, and no farther than the farthest that is to be seen in
it. With cross-talk it may hear its neighbour's echo instead: half the way from the
neighbour to a point that the neighbour's bounds hold for, and on to this sonar. By the
triangle's inequality the way on is the way out, give or take the distance between both
sonars; half the way is the neighbour's range, give or take half of it.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.poses import compose
from albot_core.geometry.types import Pose, Poses, Ranges, Segments
from albot_core.sensing.reading import SonarScan
from albot_env.stress.geometry import free_ways, nearest_in_cones, wall_distances
from albot_env.stress.limits import Limits

_LOOKS = (31, 1001)
"""In how many directions the farthest surface in a cone is looked for, at first, and where
that leaves a doubt: gaps of 2 mm at 4 m are missed."""
_SLACK = 0.01
"""How much farther a surface may be between two directions, as a share: at most 0.8 % on a
wall that is hit within 25° of its perpendicular."""
_REACH = 1.1
"""Surfaces this many times as far from the robot's middle as sonars reach are not heard."""
_ROUNDING = 1e-6
"""How far off the simulator's arithmetic may be (m)."""


def check_sonar(surfaces: Segments, pose: Pose, scan: SonarScan, limits: Limits) -> list[str]:
    """Every echo comes from a surface that the sonar or a neighbour may hear, or from none.

    Args:
        surfaces: The walls, and what moves (world frame).
        pose: True pose of the robot (world frame).
        scan: What the sonars say.
        limits: What may be.
    """
    if not np.isfinite(pose).all():
        return []  # There is no such place; the check of the info tells it.
    geometry, echoes = scan.geometry, scan.ranges
    near = surfaces[wall_distances(surfaces, pose[:2]) < _REACH * geometry.max_range]
    ears = compose(pose, np.column_stack((np.array(geometry.places), geometry.bearings)))
    heard, half = np.flatnonzero(echoes < np.inf), geometry.cone / 2
    nearest = _with_neighbours(ears, nearest_in_cones(near, ears, half), -1.0)
    least = nearest - limits.echo_error(nearest) - _ROUNDING
    wrong = [
        f"sonar {sonar} hears {echoes[sonar]:.3f} m, nothing is before {nearest[sonar]:.3f} m"
        for sonar in heard[echoes[heard] < least[heard]].tolist()
    ]
    for looks in _LOOKS:  # Most need not be looked at closely.
        farthest = _with_neighbours(ears, _farthest_in_cones(near, ears, half, looks), 1.0)
        most = np.maximum(farthest * (1 + _SLACK) + limits.echo_error(farthest), geometry.min_range)
        beyond = heard[echoes[heard] > np.minimum(most, geometry.max_range)[heard]]
        if not len(beyond):
            return wrong
    return wrong + [
        f"sonar {sonar} hears {echoes[sonar]:.3f} m, through a surface at {farthest[sonar]:.3f} m"
        for sonar in beyond.tolist()
    ]


def _with_neighbours(ears: Poses, own: Ranges, sign: float) -> Ranges:
    """The bound of every sonar and its neighbours: the least with sign -1, the most with 1."""
    apart = np.hypot(*np.diff(ears[:, :2], axis=0).T)
    bounds = sign * own
    bounds[:-1] = np.maximum(bounds[:-1], sign * own[1:] + apart / 2)
    bounds[1:] = np.maximum(bounds[1:], sign * own[:-1] + apart / 2)
    return sign * bounds


def _farthest_in_cones(
    surfaces: Segments, ears: Poses, half_angle: float, looks: int
) -> Float64[np.ndarray, "ears"]:
    """Distance (m) to the farthest surface to be seen in every cone, in so many directions."""
    bearings = np.linspace(-half_angle, half_angle, looks)
    return np.array([free_ways(surfaces, ear, bearings).max() for ear in ears])
