"""Map correction: experiences move until they fit what the odometer measured between them.

Equations (12) to (14), section 4.3. Headings and the turns of links are unwrapped, so that the
correction keeps the winding of the links.

Experience 0 is fixed: the map's frame is the robot's frame at its first reading. The paper fixes no
experience, so its maps may drift and turn as a whole.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel

Links = tuple[np.ndarray, np.ndarray, np.ndarray]
"""(links,) sources and targets, int64; and (links, 3) motions: each target's pose in its source's
frame (m, m, unwrapped rad)."""


@kernel()
def discrepancy(
    poses: np.ndarray, source: int, target: int, motion: np.ndarray
) -> tuple[float, float, float]:
    """Return a target's offset from where its link puts it: x, y (m), unwrapped heading (rad).

    d_ij cos(θ_i + θ_ij) and d_ij sin(θ_i + θ_ij) are the link's x and y, turned by θ_i.
    """
    heading = poses[source, 2]
    east, north = rotate(math.cos(heading), math.sin(heading), motion[0], motion[1])
    return (
        poses[target, 0] - east - poses[source, 0],
        poses[target, 1] - north - poses[source, 1],
        poses[target, 2] - motion[2] - heading,
    )


@kernel()
def correct_link_by_link(
    poses: np.ndarray, links: Links, count: int, rate: float, stiffness: np.ndarray
) -> None:
    """Run one pass: each link in turn moves its two experiences, equally and oppositely.

    This is stable for every rate below 1, with any graph. At 1/2 a link fits exactly after its
    step. Above 1/2 the step overshoots, but by less than the previous error.

    `stiffness` (links,), from 0 to 1, is each link's share of the rate: the least trusted links
    take up most of a discrepancy. In the paper all are 1.
    """
    sources, targets, motions = links
    for k in range(count):
        i, j = sources[k], targets[k]
        x, y, heading = discrepancy(poses, i, j, motions[k])
        # The target moves back, the source forth; if one is fixed, the other moves by both.
        share = rate * stiffness[k]
        back = 2.0 * share if i == 0 else share
        forth = 2.0 * share if j == 0 else share
        if j != 0:
            poses[j, 0] -= back * x
            poses[j, 1] -= back * y
            poses[j, 2] -= back * heading
        if i != 0:
            poses[i, 0] += forth * x
            poses[i, 1] += forth * y
            poses[i, 2] += forth * heading


@kernel()
def correct_all_at_once(
    poses: np.ndarray,
    links: Links,
    count: int,
    rate: float,
    changes: np.ndarray,
    limited: bool,
) -> None:
    """Run one pass of eq. (12) to (14) as written: all experiences from the same poses.

    The last term of eq. (14) is read as -y_i, as in (12) and (13); -y_k is a misprint. `changes`
    (experiences, 4) is a scratch array.

    This is a step of gradient descent. It diverges unless the rate is below 2 / λ, where λ is the
    largest eigenvalue of the graph's Laplacian. λ is at least one more than the number of links at
    any experience: with α = 0.5 and four links at an experience the step diverges. If `limited`,
    the rate of an experience is at most 1 / its number of links (a Jacobi step): then no step
    diverges, because all eigenvalues of that iteration are within [-1, 1]. This is our addition.
    """
    sources, targets, motions = links
    changes[:] = 0.0
    for k in range(count):
        i, j = sources[k], targets[k]
        x, y, heading = discrepancy(poses, i, j, motions[k])
        changes[j, 0] -= x  # Eq. (13), the sum over links to the experience.
        changes[j, 1] -= y  # Eq. (14).
        changes[j, 2] -= heading  # Eq. (12).
        changes[i, 0] += x  # The sums over links from the experience.
        changes[i, 1] += y
        changes[i, 2] += heading
        changes[i, 3] += 1.0
        changes[j, 3] += 1.0
    for i in range(1, poses.shape[0]):
        share = min(rate, 1.0 / max(changes[i, 3], 1.0)) if limited else rate
        for axis in range(3):
            poses[i, axis] += share * changes[i, axis]
