"""GMapping's search for the pose at which the scan fits best."""

from __future__ import annotations

import numpy as np
import pytest

from albot_core.geometry.poses import relative
from albot_core.mappers.slam.beam_model import beam_tables, cut_patch, weigh_points
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


def test_the_proposal_is_of_motion_and_scan_over_all_samples():
    """Lines 11 to 21, by a slow sum: mean, covariance and weight. The search is switched off."""
    config = GMappingConfig(particles=4, iterations=0)
    true, deviations = np.array((0.5, 0.2, 0.3)), np.array((0.03, 0.02, 0.01))
    guess = true + np.array((0.03, -0.02, 0.01))
    particles = Particles(4, config.grid)
    particles.poses[:] = true
    particles.integrate(scan_from(true))
    particles.poses[:] = 0.0
    points, _ = matched_points(scan_from(true), config.grid.reach, config.beams.spacing)
    tables = beam_tables(config.beams, config.grid.cell)
    arrays, cell = particles.pool.arrays, config.grid.cell
    patch, low = cut_patch(arrays, particles.index[0], particles.corner, cell, points, guess)
    search = Search(0.05, 0.05, 0, 3, 0.02, np.radians(0.5), -1.0)
    steps = np.stack(np.meshgrid(*[(-1, 0, 1)] * 3), axis=-1).reshape(-1, 3)
    offs = steps * (0.02, 0.02, np.radians(0.5))
    scan = [
        weigh_points(patch, low, cell, points, *(guess + off).tolist(), tables.log_likelihoods)
        for off in offs
    ]
    motion = -0.5 * ((relative(guess, guess + offs) / deviations) ** 2).sum(axis=1)
    weights = np.exp(scan + motion)
    mean = np.average(guess + offs, axis=0, weights=weights)
    covariance = np.cov((guess + offs).T, aweights=weights, bias=True)

    log_weights, noise = np.zeros(4), np.concatenate((np.zeros((1, 3)), np.eye(3)))
    draw_poses(
        arrays, particles.index, particles.corner, cell, points, guess, deviations, noise,
        tables, search, particles.poses, log_weights,
    )  # fmt: skip
    np.testing.assert_allclose(particles.poses[0], mean, atol=1e-9)
    root = (particles.poses[1:] - mean).T  # Its columns are those of the Cholesky factor.
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-9)
    np.testing.assert_allclose(log_weights, np.log(weights.mean()))
