"""FastSLAM's filter: particles with a Kalman filter for each of their landmarks. Compiled.

M. Montemerlo, S. Thrun, D. Koller and B. Wegbreit, FastSLAM 2.0: an improved particle filtering
algorithm for simultaneous localization and mapping that provably converges, IJCAI 2003; and
FastSLAM, AAAI 2002. In 2.0 (`proposes`) a particle's pose is drawn where its motion and the
landmarks that it sees agree; in 1.0 by its motion alone.

The papers observe ranges and bearings by an extended Kalman filter. Here an observation is a point
in the robot's frame, with the covariance that its range and bearing give it (D. Lerro and Y.
Bar-Shalom, Tracking with debiased consistent converted measurements, IEEE TAES 29, 1993). So it is
linear in the landmark: given the path, a landmark's filter is exact, and no landmark is so near
that its bearing has no derivative.
"""

from __future__ import annotations

import math

import numpy as np

from albot_core.geometry.pose_kernels import compose, wrap_angle
from albot_core.kernels.compiled import ZERO, kernel, scratch

X, Y, XX, XY, YY = range(5)
"""Columns of a landmark: its position (m) and the covariance of its error (m²)."""
NEW, NOTHING = -1, -2
"""Marks of an observation: of a landmark that is new to the particle; not associated yet."""
_LOG_2_PI = math.log(2.0 * math.pi)

_matrix = scratch(3, 3)


@kernel(arrays=True, nogil=True)
def move_and_weigh(
    landmarks: np.ndarray,
    counts: np.ndarray,
    seen: np.ndarray,
    motion: np.ndarray,
    deviations: np.ndarray,
    noise: np.ndarray,
    proposes: bool,
    limits: tuple[float, float],
    poses: np.ndarray,
    log_weights: np.ndarray,
    matched: np.ndarray,
) -> None:
    """Move each particle, match what it sees with its landmarks, and weigh it.

    Args:
        landmarks: The landmarks of each particle (particles, room, 5), map frame.
        counts: Number of landmarks of each particle (particles,).
        seen: What is seen, see `SeenLandmarks` (n, 5).
        motion: The motion since the last update, in the robot's frame at that update (3,).
        deviations: Its standard deviations, along the robot's axes now (m, m, rad), (3,).
        noise: Standard normal numbers (particles, 3).
        proposes: Whether poses are drawn where motion and landmarks agree (FastSLAM 2.0).
        limits: Largest squared Mahalanobis distance of a landmark that is matched, and the log of
            the likelihood of a new landmark (1/m²).
        poses: The poses (particles, 3), changed in place.
        log_weights: The log-weights (particles,), changed in place.
        matched: The landmark of each observation by particle, or `NEW` (particles, n); written
            over.
    """
    mean = np.empty(3)
    for k in range(len(poses)):
        mean[0], mean[1], mean[2] = compose(poses[k], motion)
        spread = _matrix()
        if proposes:
            _motion_covariance(mean[2], deviations, spread)
        else:
            _draw_motion(deviations, noise[k], mean)
            for i in range(3):
                for j in range(3):
                    spread[i, j] = 0.0
        for i in range(len(seen)):
            matched[k, i] = NOTHING
        for i in range(len(seen)):
            # Eq. (13) and (14): the likeliest landmark, or a new one.
            n, likelihood = _associate(
                landmarks[k], counts[k], seen[i], mean, spread, limits, matched[k]
            )
            matched[k, i] = n
            log_weights[k] += likelihood  # Eq. (17), the product over all that is seen.
            if n >= 0 and proposes:
                _propose(landmarks[k, n], seen[i], mean, spread)
        if proposes:
            _draw(spread, noise[k], mean)
        poses[k, 0], poses[k, 1], poses[k, 2] = mean[0], mean[1], wrap_angle(mean[2])


@kernel()
def _motion_covariance(heading: float, deviations: np.ndarray, spread: np.ndarray) -> None:
    """Write the covariance of a motion, whose errors are along the robot's axes, to `spread`."""
    cos, sin = math.cos(heading), math.sin(heading)
    along, across = deviations[0] * deviations[0], deviations[1] * deviations[1]
    spread[0, 0] = cos * cos * along + sin * sin * across
    spread[0, 1] = spread[1, 0] = cos * sin * (along - across)
    spread[1, 1] = sin * sin * along + cos * cos * across
    spread[0, 2] = spread[1, 2] = spread[2, 0] = spread[2, 1] = 0.0
    spread[2, 2] = deviations[2] * deviations[2]


@kernel()
def _draw_motion(deviations: np.ndarray, noise: np.ndarray, pose: np.ndarray) -> None:
    """Add a motion's random error, along the robot's axes, to a pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    along, across = deviations[0] * noise[0], deviations[1] * noise[1]
    pose[0] += cos * along - sin * across
    pose[1] += sin * along + cos * across
    pose[2] += deviations[2] * noise[2]


@kernel()
def _associate(
    landmarks: np.ndarray,
    count: int,
    point: np.ndarray,
    pose: np.ndarray,
    spread: np.ndarray,
    limits: tuple[float, float],
    taken: np.ndarray,
) -> tuple[int, float]:
    """Return the landmark that an observation is of, or `NEW`, and its log-likelihood (1/m²).

    It is the likeliest one within the gate that no other observation has (`taken`); new if a new
    one is likelier.
    """
    gate, new = limits
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    zx, zy = point[0], point[1]
    moved = 2.0 * (spread[0, 0] + spread[1, 1]) + point[2] + point[4]
    best, likeliest = ZERO + NEW, new
    for n in range(count):
        dx, dy = landmarks[n, X] - pose[0], landmarks[n, Y] - pose[1]
        vx, vy = zx - (cos * dx + sin * dy), zy - (cos * dy - sin * dx)
        # Most landmarks are too far: the gate is within the trace of the innovation's covariance,
        # which is at most this, as 2 ab <= a² + b² for position and heading.
        turned = 2.0 * spread[2, 2] * (dx * dx + dy * dy)
        if vx * vx + vy * vy > gate * (moved + turned + landmarks[n, XX] + landmarks[n, YY]):
            continue
        a, b, c = _innovation(landmarks[n], point, cos, sin, zx - vx, zy - vy, spread)
        determinant = a * c - b * b
        square = (c * vx * vx - 2.0 * b * vx * vy + a * vy * vy) / determinant
        if square > gate:
            continue
        likelihood = -0.5 * (square + math.log(determinant)) - _LOG_2_PI
        if likelihood > likeliest and not _holds(taken, n):
            best, likeliest = n, likelihood
    return best, likeliest


@kernel()
def _holds(numbers: np.ndarray, number: int) -> bool:
    """Return whether an array holds a number."""
    for k in range(len(numbers)):  # noqa: SIM110, a loop as compiled
        if numbers[k] == number:
            return True
    return False


@kernel()
def _innovation(
    landmark: np.ndarray,
    point: np.ndarray,
    cos: float,
    sin: float,
    zx: float,
    zy: float,
    spread: np.ndarray,
) -> tuple[float, float, float]:
    """Return xx, xy, yy of the covariance of an observation (m²): eq. (15), before drawing.

    It is that of the pose, of the landmark and of the observation together. (zx, zy) is the
    landmark as expected in the robot's frame.
    """
    xx, xy, yy = landmark[XX], landmark[XY], landmark[YY]
    pxx, pxy, pyy = spread[0, 0], spread[0, 1], spread[1, 1]
    pxt, pyt, ptt = spread[0, 2], spread[1, 2], spread[2, 2]
    # Positions of robot and landmark, turned into the robot's frame.
    sxx, sxy, syy = xx + pxx, xy + pxy, yy + pyy
    a = cos * cos * sxx + 2.0 * cos * sin * sxy + sin * sin * syy
    b = cos * sin * (syy - sxx) + (cos * cos - sin * sin) * sxy
    c = sin * sin * sxx - 2.0 * cos * sin * sxy + cos * cos * syy
    # The heading moves what is seen by (zy, -zx), and may depend on the position.
    ex, ey = -(cos * pxt + sin * pyt), sin * pxt - cos * pyt
    a += ptt * zy * zy + 2.0 * zy * ex + point[2]
    b += -ptt * zx * zy - zx * ex + zy * ey + point[3]
    c += ptt * zx * zx - 2.0 * zx * ey + point[4]
    return a, b, c


@kernel()
def _propose(landmark: np.ndarray, point: np.ndarray, pose: np.ndarray, spread: np.ndarray) -> None:
    """Refine the proposal of a pose by an observation of a known landmark: eq. (8) to (11).

    Several observations are used one after another (Montemerlo's thesis, CMU 2003, section 4.3).
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    dx, dy = landmark[X] - pose[0], landmark[Y] - pose[1]
    zx, zy = cos * dx + sin * dy, cos * dy - sin * dx
    a, b, c = _innovation(landmark, point, cos, sin, zx, zy, spread)
    determinant = a * c - b * b
    vx, vy = point[0] - zx, point[1] - zy
    gain, h = _matrix(), _matrix()
    h[0, 0], h[0, 1], h[0, 2] = -cos, -sin, zy
    h[1, 0], h[1, 1], h[1, 2] = sin, -cos, -zx
    cross = _matrix()  # Covariance of pose and observation, (3, 2).
    for i in range(3):
        for j in range(2):
            cross[i, j] = spread[i, 0] * h[j, 0] + spread[i, 1] * h[j, 1] + spread[i, 2] * h[j, 2]
        gain[i, 0] = (c * cross[i, 0] - b * cross[i, 1]) / determinant
        gain[i, 1] = (a * cross[i, 1] - b * cross[i, 0]) / determinant
    for i in range(3):
        pose[i] += gain[i, 0] * vx + gain[i, 1] * vy
        for j in range(3):
            spread[i, j] -= gain[i, 0] * cross[j, 0] + gain[i, 1] * cross[j, 1]
    for i in range(3):
        for j in range(i):  # Rounding must not make it unsymmetric.
            spread[i, j] = spread[j, i] = 0.5 * (spread[i, j] + spread[j, i])


@kernel()
def _draw(spread: np.ndarray, noise: np.ndarray, pose: np.ndarray) -> None:
    """Add a random error with a covariance to a pose, by its Cholesky factor: eq. (12)."""
    a = math.sqrt(max(spread[0, 0], 1e-18))
    b, d = spread[1, 0] / a, spread[2, 0] / a
    c = math.sqrt(max(spread[1, 1] - b * b, 1e-18))
    e = (spread[2, 1] - b * d) / c
    f = math.sqrt(max(spread[2, 2] - d * d - e * e, 0.0))
    pose[0] += a * noise[0]
    pose[1] += b * noise[0] + c * noise[1]
    pose[2] += d * noise[0] + e * noise[1] + f * noise[2]


@kernel(nogil=True)
def update_landmarks(
    landmarks: np.ndarray,
    counts: np.ndarray,
    seen: np.ndarray,
    matched: np.ndarray,
    poses: np.ndarray,
) -> int:
    """Update the landmarks that each particle sees, and add the new ones.

    Args:
        landmarks: See `move_and_weigh`; changed in place. There is room for as many as allowed.
        counts: Number of landmarks of each particle (particles,), changed in place.
        seen: What is seen (n, 5).
        matched: The landmark of each observation by particle, or `NEW` (particles, n).
        poses: The poses (particles, 3).

    Returns:
        The number of new landmarks for which there was no room, over all particles.
    """
    refused = ZERO
    for k in range(len(poses)):
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for i in range(len(seen)):
            x = poses[k, 0] + cos * seen[i, 0] - sin * seen[i, 1]
            y = poses[k, 1] + sin * seen[i, 0] + cos * seen[i, 1]
            xx, xy, yy = seen[i, 2], seen[i, 3], seen[i, 4]
            gxx = cos * cos * xx - 2.0 * cos * sin * xy + sin * sin * yy
            gxy = cos * sin * (xx - yy) + (cos * cos - sin * sin) * xy
            gyy = sin * sin * xx + 2.0 * cos * sin * xy + cos * cos * yy
            n = matched[k, i]
            if n >= 0:
                _fuse(landmarks[k, n], x, y, gxx, gxy, gyy)
            elif counts[k] == landmarks.shape[1]:
                refused += 1
            else:
                n = counts[k]
                landmarks[k, n, X], landmarks[k, n, Y] = x, y
                landmarks[k, n, XX], landmarks[k, n, XY], landmarks[k, n, YY] = gxx, gxy, gyy
                counts[k] += 1
    return int(refused)


@kernel()
def _fuse(landmark: np.ndarray, x: float, y: float, xx: float, xy: float, yy: float) -> None:
    """Update a landmark by a point with a covariance, both in the map: its Kalman filter."""
    pxx, pxy, pyy = landmark[XX], landmark[XY], landmark[YY]
    a, b, c = pxx + xx, pxy + xy, pyy + yy
    determinant = a * c - b * b
    # The gain P S⁻¹.
    k00, k01 = (pxx * c - pxy * b) / determinant, (pxy * a - pxx * b) / determinant
    k10, k11 = (pxy * c - pyy * b) / determinant, (pyy * a - pxy * b) / determinant
    vx, vy = x - landmark[X], y - landmark[Y]
    landmark[X] += k00 * vx + k01 * vy
    landmark[Y] += k10 * vx + k11 * vy
    # P S⁻¹ R instead of P - P S⁻¹ P: a product of what is positive, so rounding leaves it so.
    landmark[XX] = k00 * xx + k01 * xy
    landmark[XY] = 0.5 * (k00 * xy + k01 * yy + k10 * xx + k11 * xy)
    landmark[YY] = k10 * xy + k11 * yy
