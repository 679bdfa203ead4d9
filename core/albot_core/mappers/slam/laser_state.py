"""A laser and its scans in a mapper's state."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.mappers.schema import Arrays, Sizes
from albot_core.sensing.reading import LaserGeometry, LaserScan


def laser_numbers(
    scans: Sequence[LaserScan],
) -> tuple[Float64[np.ndarray, "6"], Float64[np.ndarray, "scans beams"]]:
    """Return the numbers of the scans' laser besides its number of beams, and all ranges (m)."""
    laser = scans[0].geometry if scans else LaserGeometry(beams=2)
    numbers = np.array((laser.first_bearing, laser.spacing, laser.max_range, *laser.mount))
    return numbers, np.array([scan.ranges for scan in scans]).reshape(-1, laser.beams)


def laser_of(numbers: Float64[np.ndarray, "6"], beams: int) -> LaserGeometry:
    """Return the laser with these numbers.

    Raises:
        InputError: There is no such laser.
    """
    first_bearing, spacing, most, x, y, heading = numbers.tolist()
    try:
        return LaserGeometry(
            beams=beams,
            first_bearing=first_bearing,
            spacing=spacing,
            max_range=most,
            mount=(x, y, heading),
        )
    except InputError as error:
        raise InputError("laser", error.expected, error.found) from None


def check_laser(state: Arrays, sizes: Sizes) -> None:
    """Raise InputError unless the array `laser` describes a laser."""
    laser_of(state["laser"], sizes["beams"])
