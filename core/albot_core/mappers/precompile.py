"""Compile a mapper before it is needed: `python -m albot_core.mappers.precompile albot1`.

In a process of its own this takes the time of another processor.
"""

from __future__ import annotations

import sys

import numpy as np

from albot_core.mappers.registry import make_mappers
from albot_core.sensing.reading import LaserGeometry, Readings, SonarGeometry


def precompile(mapper: str) -> None:
    """Let a mapper take in two readings, so that all it runs is compiled and kept.

    Raises:
        InputError: There is no such mapper.
    """
    mappers, laser, sonar = make_mappers(mapper, 1), LaserGeometry(), SonarGeometry()
    readings = Readings(
        stamps=np.zeros(1),
        motions=np.zeros((1, 3)),
        laser=laser,
        ranges=np.full((1, laser.beams), 5.0),
        sonar=sonar,
        echoes=np.full((1, len(sonar.bearings)), 2.0),
    )
    for _ in range(2):
        mappers.update(np.zeros(1, np.int64), readings)


if __name__ == "__main__":
    precompile(sys.argv[1])
