"""The local topological level: what a region around the robot is to the present visit."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.hssh.config import HsshConfig, PlaceConfig
from albot_core.mappers.hssh.gateways import Ground, crossed
from albot_core.mappers.hssh.region import Region
from albot_core.mappers.hssh.visit import Visit, open_ground_of, surface_of


def is_place(region: Region, robot: Float64[np.ndarray, "2"], config: HsshConfig) -> bool:
    """Return whether a region that the robot has come into is a place.

    Args:
        region: The region.
        robot: The robot's position (m).
        config: All parameters.
    """
    if not len(region.gateways) or region.is_path(config.gateways):
        return False
    if region.is_whole:
        return True
    # A path whose far end was not seen yet, or a place ahead beyond such a path.
    away = float(np.hypot(*(region.peak - robot)))
    return away <= region.clearance and not region.is_narrow(config.gateways)


def entered_by(region: Region, track: Float64[np.ndarray, "readings 2"]) -> int:
    """Return the gateway of a region that the robot has crossed last; -1 if it has crossed none.

    Args:
        region: The region.
        track: Where the robot was since it came to the last place, in order (m).
    """
    latest_first = track[::-1]
    # Of each gateway: the latest reading at which the robot was outside of it.
    best, latest = -1, len(track)
    for k, line in enumerate(region.gateways):
        ahead, aside = _beside(line[None], latest_first)
        outside = np.flatnonzero((ahead > 0.0) & (ahead < 1.0) & (aside <= 0.3))
        if len(outside) and outside[0] < latest:
            best, latest = k, int(outside[0])
    return best


def is_back(region: Region, arrived: int, last: Visit, near: float) -> bool:
    """Return whether the robot has turned round, and comes back by the gateway it left by.

    Args:
        region: The region that it has come to.
        arrived: The gateway of the region through which it came.
        last: The visit that it has left.
        near: `PlaceConfig.near` (m).
    """
    left, came = last.gateways[last.left], region.gateways[arrived]
    away = float(np.hypot(*(region.middles[arrived] - last.middles[last.left])))
    return away <= near and bool(np.dot(left[2:] - left[:2], came[2:] - came[:2]) > 0.0)


def is_settled(visit: Visit, region: Region, pose: Pose) -> bool:
    """Return whether a region tells nothing more of the place that the robot is in."""
    x, y, _ = pose.tolist()
    if len(visit.gateways) and crossed(visit.gateways, x, y, 0.0) >= 0:
        return True  # It stands behind a gateway, but has not gone far enough to have left.
    # Else its star is settled, and a part of the place lies outside of the local map now.
    return not region.is_whole and not visit.unknown


def perceived(
    visit: Visit, ground: Ground, region: Region, arrived: int, places: PlaceConfig
) -> Visit:
    """Return a visit with what is known of the place now.

    Args:
        visit: The visit.
        ground: The part of the local map.
        region: The region of the place.
        arrived: The gateway through which the robot came; -1 if it began here.
        places: What is kept.
    """
    around = max(places.around, region.clearance + places.beside)
    return visit._replace(
        arrived=arrived,
        middle=region.peak,
        gateways=region.gateways,
        unknown=region.unknown,
        surface=surface_of(ground, region.peak, around, places.points),
        open_ground=open_ground_of(ground, region.peak, around),
    )


def _beside(
    lines: Segments, points: Points
) -> tuple[Float64[np.ndarray, "n"], Float64[np.ndarray, "n"]]:
    """Return how far points lie to the right of a line, and how far beyond its ends (m)."""
    along = lines[:, 2:] - lines[:, :2]
    lengths = np.maximum(np.hypot(*along.T), 1e-9)
    along = along / lengths[:, None]
    to = points - lines[:, :2]
    ahead = to[:, 0] * along[:, 1] - to[:, 1] * along[:, 0]
    at = np.sum(to * along, axis=1)
    return ahead, np.maximum(-at, at - lengths)
