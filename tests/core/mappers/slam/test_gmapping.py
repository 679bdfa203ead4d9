"""GMapping's search for the pose at which the scan fits best."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import relative
from albot_core.mappers.slam.beam_model import beam_tables
from albot_core.mappers.slam.gmapping import GMappingConfig, Search, draw_poses
from albot_core.mappers.slam.particles import Particles
from albot_core.matching.scan_points import matched_points
from tests.core.mappers.slam.rooms import scan_from


@pytest.mark.parametrize("heading", [0.8, -2.2])
def test_a_guess_that_is_off_to_any_side_is_mended(heading):
    """With one sample, as in the program, the pose is the best one that the search finds."""
    offs = 0.08 * np.concatenate((np.eye(3), -np.eye(3)))  # m, m, rad
    config = GMappingConfig(particles=len(offs), samples=1)
    true, particles = np.array((0.5, 0.2, heading)), Particles(len(offs), config.grid)
    particles.poses[:] = true
    particles.integrate(scan_from(true))
    points, _ = matched_points(scan_from(true), config.grid.reach, config.beams.spacing)
    tables = beam_tables(config.beams, config.grid.cell)
    search = Search(0.05, 0.05, 5, config.samples, 0.02, np.radians(0.5), config.least_score)
    for particle, off in enumerate(offs):
        particles.poses[:] = true
        draw_poses(
            particles.pool.arrays, particles.index, particles.corner, config.grid.cell, points,
            off, np.full(3, 0.2), np.zeros((len(offs), 3)), tables, search, particles.poses,
            np.zeros(len(offs)),
        )  # fmt: skip
        # To half a cell: one scan leaves the map no finer.
        np.testing.assert_allclose(relative(true, particles.poses[particle]), 0, atol=0.025)
