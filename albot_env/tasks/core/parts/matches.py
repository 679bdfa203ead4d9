"""The part `matches`: earlier readings at the present place, and how sure the mapper is of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float64

from albot_core.geometry.pose_kernels import rotate_back
from albot_core.geometry.types import Points
from albot_core.kernels.compiled import kernel
from albot_core.robot import CONTROL_STEP
from albot_env.tasks.core.parts.beliefs import all_towards, observe_point
from albot_env.tasks.core.parts.part import Need, ObservationPart, Sources
from albot_env.tasks.core.parts.scales import Scales, make_log_scale, scaled, unscaled

COLUMNS = 8
"""Number of numbers per match."""
AGES = make_log_scale(30.0, 3600.0)
"""The scale of ages (s)."""


class ObservedMatches(NamedTuple):
    """The best matches of the present place, the best first; see `PlaceMatches`."""

    scores: Float64[np.ndarray, "matches"]
    """How much of what is seen now was seen there, from 0 to 1."""
    probabilities: Float64[np.ndarray, "matches"]
    """How probable it is that the two places are one."""
    ambiguities: Float64[np.ndarray, "matches"]
    """The highest probability of another place."""
    points: Points
    """Where the readings were taken, as believed now (m, robot's frame)."""
    ages: Float64[np.ndarray, "matches"]
    """How long ago the readings were taken (s)."""


def _decode_matches(numbers: Float[np.ndarray, "matches 8"], scales: Scales) -> ObservedMatches:
    """Return the matches that are shown."""
    rows = numbers[numbers[:, 0] > 0]
    shares = (np.asarray(rows[:, 1:4], np.float64) + 1) / 2
    return ObservedMatches(
        scores=shares[:, 0],
        probabilities=shares[:, 1],
        ambiguities=shares[:, 2],
        points=all_towards(rows[:, 4:7], scales),
        ages=np.array([unscaled(float(number), AGES) for number in rows[:, 7]]),
    )


MATCHES = ObservationPart(
    name="matches",
    numbers="3 × 8",
    meaning=(
        "on request, with mappers that say how sure they are of places: one row for each of the "
        "three best earlier readings in the present place: 1, score (how much of what is in view "
        "is known from there), probability that the place is the one it is taken for, ambiguity "
        "(the highest probability of another place), each from -1 to 1, direction and distance of "
        "where the reading was taken, and its age, logarithmic to an hour; without a match -1, 0, "
        "0, …"
    ),
    shape=lambda sizes: (sizes.matches, COLUMNS),
    needs=frozenset((Need.MAP,)),
    decode=_decode_matches,
)


@kernel()
def fill_matches(i: int, sources: Sources, row: np.ndarray) -> None:
    """Fill in the best matches of robot i's place, as they were when its map changed last."""
    matches, belief = sources.maps.matches, sources.state.beliefs[i]
    cos, sin = math.cos(belief[2]), math.sin(belief[2])
    for k in range(sources.scales.matches):
        shown = row[k * COLUMNS : (k + 1) * COLUMNS]
        for j in range(COLUMNS):
            shown[j] = np.float32(-1.0 if j == 0 else 0.0)
        if k >= matches.counts[i]:
            continue
        match = matches.rows[i, k]
        shown[0] = np.float32(1.0)
        for j in range(3):
            shown[1 + j] = np.float32(2.0 * match[j] - 1.0)
        ahead, left = rotate_back(cos, sin, match[3] - belief[0], match[4] - belief[1])
        observe_point(ahead, left, sources.scales.home, shown[4:7])
        age = sources.maps.readings[i] - match[5]
        shown[7] = scaled(max(age, 0.0) * CONTROL_STEP, AGES)
