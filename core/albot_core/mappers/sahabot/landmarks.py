"""Landmarks in a panorama, and the direction of the nest that they tell (thesis, figure 2.13a).

Directions are those of the compass, so that a landmark vector of the nest and one of now can be
subtracted.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float64

from albot_core.geometry.types import Points, Segments
from albot_core.kernels.compiled import kernel
from albot_core.mappers.sahabot.config import SectorConfig

Panorama = Float64[np.ndarray, "directions"]
Sectors = Float64[np.ndarray, "_ 3"]
"""Sectors of a panorama. Columns: direction of the centre (rad), width (rad), mean range (m)."""
_RADIAL = 1.0 / 3.0
"""Weight of a radial vector of the snapshot model beside a tangential one: 1 to 3, as in Cartwright
and Collett, Landmark learning in bees (1983)."""


def find_landmarks(panorama: Panorama, config: SectorConfig) -> Sectors:
    """Return the landmarks in a panorama, counter-clockwise.

    Args:
        panorama: Ranges (m) in equally spaced directions, infinite where nothing came back;
            negative where the robot has not looked.
        config: What counts as a landmark.
    """
    found = np.empty((len(panorama), 3))
    thresholds = config.jump, config.reach, config.widest
    return found[: _find_landmarks(panorama, *thresholds, found)].copy()


@kernel(nogil=True)
def _find_landmarks(
    panorama: np.ndarray, jump: float, reach: float, widest: float, found: np.ndarray
) -> int:
    """Fill `found` with the landmarks; return their number."""
    count = panorama.shape[0]
    spacing = 2.0 * math.pi / count
    first = -1
    for k in range(count):  # A jump at which to begin, so that no sector is cut in two.
        if _is_jump(panorama[k - 1], panorama[k], jump):
            first = k
            break
    landmarks = 0
    if first < 0:
        return landmarks
    begin = first
    for k in range(first + 1, first + count + 1):
        last, here = panorama[(k - 1) % count], panorama[k % count]
        if not _is_jump(last, here, jump):
            continue
        start, before = panorama[begin % count], panorama[(begin - 1) % count]
        is_own = before > start and here > last  # False beside a direction not looked in.
        total, is_near = 0.0, True
        for m in range(begin, k):
            total += panorama[m % count]
            is_near &= 0.0 <= panorama[m % count] <= reach
        width = (k - begin) * spacing
        if is_own and is_near and width <= widest:
            middle = 0.5 * (begin + k - 1) * spacing
            found[landmarks, 0] = middle - 2.0 * math.pi * math.floor(middle / (2.0 * math.pi))
            found[landmarks, 1] = width
            found[landmarks, 2] = total / (k - begin)
            landmarks += 1
        begin = k
    return landmarks


@kernel()
def _is_jump(one: float, other: float, jump: float) -> bool:
    """Return whether the range jumps between two directions, or one was not looked in."""
    if one == other:  # Also where both are infinite.
        return False
    return one < 0.0 or other < 0.0 or abs(one - other) > jump


def landmark_vectors(landmarks: Sectors) -> Points:
    """Return the unit vector to each landmark, by the centre of its sector."""
    return np.stack((np.cos(landmarks[:, 0]), np.sin(landmarks[:, 0])), axis=-1)


def average_landmark_vector(landmarks: Sectors) -> Float64[np.ndarray, "2"]:
    """Return the average landmark vector (AL): the mean of the landmark vectors; 0 for none."""
    if not len(landmarks):
        return np.zeros(2)
    return np.asarray(landmark_vectors(landmarks).mean(axis=0))


class Homing(NamedTuple):
    """What landmarks tell of the nest."""

    direction: Float64[np.ndarray, "2"]
    """The home vector: it points towards the nest, and its length is no distance."""
    distance: float
    """Estimated distance from the nest (m): ours."""


def home_by_average(now: Sectors, nest: Sectors) -> Homing:
    """Return the home vector of the average landmark vector model: AL of now minus AL of the nest.

    The further the robot goes to one side, the further all landmarks move to the other. The
    distance is ours: to first order a step d changes AL by -M d, with M the mean of (I - u uᵀ) / r
    over the landmarks, so d = M⁻¹ (AL of the nest - AL of now).
    """
    direction = average_landmark_vector(now) - average_landmark_vector(nest)
    units = landmark_vectors(nest)
    across = np.eye(2) - units[:, :, None] * units[:, None, :]
    change = (across / np.maximum(nest[:, 2], 1e-3)[:, None, None]).mean(axis=0)
    # One landmark alone tells nothing along its own direction.
    distance = np.linalg.norm(np.linalg.pinv(change, rcond=1e-6) @ direction)
    return Homing(direction, float(distance))


def home_by_snapshot(now: Sectors, nest: Sectors) -> Homing:
    """Return the home vector of the snapshot model (Cartwright and Collett 1983).

    Each sector of the snapshot, landmark or gap, is paired with the sector of its kind that is
    nearest in direction now. A tangential vector of length 1 reduces the difference of directions,
    a radial one of a third the difference of widths; the home vector is their mean. The distance is
    that of `home_by_average`.
    """
    vectors = [np.zeros(2)]
    for here, there in ((now, nest), (_gaps(now), _gaps(nest))):
        for direction, width, _ in there:
            away = _turn(direction - here[:, 0])
            nearest = int(np.argmin(np.abs(away)))
            cos, sin = math.cos(here[nearest, 0]), math.sin(here[nearest, 0])
            # A step to the right of a landmark turns it to the left.
            vectors.append(np.sign(away[nearest]) * np.array((sin, -cos)))
            grows = np.sign(width - here[nearest, 1]) if here is now else 0.0
            vectors.append(_RADIAL * grows * np.array((cos, sin)))
    mean = np.sum(vectors, axis=0) / max(len(vectors) - 1, 1)
    return Homing(mean, home_by_average(now, nest).distance)


def _gaps(landmarks: Sectors) -> Sectors:
    """Return the gaps between successive landmarks, which have no range."""
    ahead = np.roll(landmarks[:, 0], -1)
    apart = np.mod(ahead - landmarks[:, 0], 2 * np.pi)
    apart[apart == 0.0] = 2 * np.pi  # One landmark alone.
    widths = apart - (landmarks[:, 1] + np.roll(landmarks[:, 1], -1)) / 2
    return np.stack((landmarks[:, 0] + apart / 2, widths, np.zeros(len(apart))), axis=-1)


def _turn(angles: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n"]:
    """Return angles in [-pi, pi)."""
    return np.asarray(np.mod(angles + np.pi, 2 * np.pi) - np.pi)


def seen_by_both(
    landmarks: Sectors, looked: Bool[np.ndarray, "directions"], spare: int = 2
) -> Sectors:
    """Return the landmarks in directions in which the other panorama was looked in, too.

    Args:
        landmarks: Landmarks of one panorama.
        looked: In which directions the other one was looked in.
        spare: How far, in directions, a landmark must be inside of them.
    """
    if looked.all() or not len(landmarks):
        return landmarks
    count = len(looked)
    safe = np.all([np.roll(looked, shift) for shift in range(-spare, spare + 1)], axis=0)
    at = np.round(landmarks[:, 0] / (2 * np.pi) * count).astype(int) % count
    return np.asarray(landmarks[safe[at]])


def landmark_chords(landmarks: Sectors) -> Segments:
    """Return the landmarks as line segments across them (m), from where they were seen."""
    reach = landmarks[:, 2]
    ends = [landmarks[:, 0] + side * landmarks[:, 1] / 2 for side in (-1.0, 1.0)]
    parts = [part for end in ends for part in (reach * np.cos(end), reach * np.sin(end))]
    return np.asarray(np.stack(parts, axis=-1).reshape(-1, 4))
