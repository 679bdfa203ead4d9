"""Compile a mapper before it is needed: `python -m albot_core.mappers.precompile albot1`.

Run in a separate process, this uses the time of another processor.
"""

from __future__ import annotations

import sys

import numpy as np

from albot_core.mappers.registry import make_mappers
from albot_core.sensing.reading import LaserGeometry, Readings, SonarGeometry


def precompile(mapper: str) -> None:
    """Let a mapper process two readings, so that all code that it runs is compiled and cached.

    Raises:
        InputError: The mapper is unknown.
    """
    mappers, laser, sonar = make_mappers(mapper, 1), LaserGeometry(), SonarGeometry()
    readings = Readings(
        stamps=np.zeros(1),
        motions=np.zeros((1, 3)),
        laser=laser,
        ranges=np.full((1, laser.beams), 5.0),
        sonar=sonar,
        echoes=np.full((1, len(sonar.bearings)), 2.0),
        compasses=np.zeros(1),
    )
    for _ in range(2):
        mappers.update(np.zeros(1, np.int64), readings)


if __name__ == "__main__":
    precompile(sys.argv[1])
