"""Map correction: experiences move until what the odometer measured between them fits.

Equations (12) to (14), section 4.3. Headings and the turns of links are unwrapped, so that the
correction never settles in another winding than that of the links.

The experience numbered 0 stays where it is: the map's frame is the robot's at its first reading.
The paper anchors none, and its maps float and turn.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import rotate
from albot_core.kernels.compiled import kernel

Links = tuple[np.ndarray, np.ndarray, np.ndarray]
"""(links,) sources and targets, int64, and (links, 3) motions: each target's pose in its source's
frame (m, m, unwrapped rad)."""


@kernel()
def discrepancy(
    poses: np.ndarray, source: int, target: int, motion: np.ndarray
) -> tuple[float, float, float]:
    """How far a target is from where its link says: x, y (m), unwrapped heading (rad).

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
    """One pass: each link in turn moves its two experiences, equally and oppositely.

    Stable for every rate below 1, whatever the graph: at 1/2 a link fits exactly once it has been
    looked at, and beyond it is overshot, but by less than it was off.

    `stiffness` (links,), from 0 to 1, is each link's share of the rate: a discrepancy goes to the
    links that are trusted least. The paper's are all 1.
    """
    sources, targets, motions = links
    for k in range(count):
        i, j = sources[k], targets[k]
        x, y, heading = discrepancy(poses, i, j, motions[k])
        # Its end moves back, its beginning forth; where one is anchored the other goes both ways.
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
    poses: np.ndarray, links: Links, count: int, rate: float, changes: np.ndarray
) -> None:
    """One pass of eq. (12) to (14) as written: all experiences from the same poses.

    The last term of eq. (14) is read as -y_i, as in (12) and (13); -y_k is a misprint. `changes`
    (experiences, 3) is worked in.

    A step of gradient descent: it diverges unless the rate is below 2 / λ, λ the greatest
    eigenvalue of the graph's Laplacian, which is at least one more than the links at any
    experience: with α = 0.5 and four links to an experience it does.
    """
    sources, targets, motions = links
    changes[:] = 0.0
    for k in range(count):
        i, j = sources[k], targets[k]
        x, y, heading = discrepancy(poses, i, j, motions[k])
        changes[j, 0] -= x  # Eq. (13), the sum over links to the experience…
        changes[j, 1] -= y  # …eq. (14)…
        changes[j, 2] -= heading  # …and eq. (12).
        changes[i, 0] += x  # The sums over links from the experience.
        changes[i, 1] += y
        changes[i, 2] += heading
    for i in range(1, poses.shape[0]):
        for axis in range(3):
            poses[i, axis] += rate * changes[i, axis]
