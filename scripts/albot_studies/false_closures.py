"""Effect of false loop closures on graph SLAM's map of a real log.

The log is mapped once. Then random closures with high confidence are added between random
keyframes, and the graph is optimised again. This is repeated with other random closures.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory, trajectory_error
from albot_core.logs.reader import read_log, read_reference
from albot_core.mappers.slam.graph_slam import GraphSlam

FARTHEST = 5.0
"""Largest relative position of two keyframes in a false closure, in x and in y (m)."""
SURE = np.diag((2500.0, 2500.0, 10000.0))
"""Information matrix of a false closure: standard deviations of 2 cm and 0.01 rad."""


@click.command()
@click.argument("log", type=PathType())
@click.option("--reference", type=PathType(), required=True)
@click.option("--share", default=0.1, show_default=True, help="Of the closures that were found.")
@click.option("--runs", default=20, show_default=True, type=CountType(1))
def command(log: Path, reference: Path, share: float, runs: int) -> None:
    """Map LOG, add false closures, and print the ATE of the corrected poses before and after."""
    recorded, truth = read_log(log), read_reference(reference)
    mapper = GraphSlam()
    for reading in recorded.readings:
        mapper.update(reading)
    known = mapper.state()

    def error(of: GraphSlam) -> float:
        poses = Trajectory(stamps=recorded.stamps, poses=of.corrected_poses())
        found = trajectory_error(poses, truth)
        if found is None:
            raise InputError(reference, "moments of the log", "stamps of another log")
        return found.rmse

    errors, count = [], round(share * mapper.graph.closures)
    for seed in range(runs):
        disturbed = GraphSlam()
        disturbed.restore(known)
        add_false_closures(disturbed, count, np.random.default_rng(seed))
        errors.append(error(disturbed))
    click.echo(
        f"graph-slam on {recorded.name}: ATE {error(mapper):.4f} m with {mapper.graph.closures} "
        f"closures; with {count} false ones besides {np.median(errors):.4f} m (median of {runs} "
        f"runs; least {min(errors):.4f}, largest {max(errors):.4f})"
    )


def add_false_closures(mapper: GraphSlam, count: int, rng: np.random.Generator) -> None:
    """Add random closures, and move the keyframes to the new optimum."""
    graph = mapper.graph
    for _ in range(count):
        source, target = sorted(rng.choice(len(graph.poses), 2, replace=False).tolist())
        motion = rng.uniform(-1.0, 1.0, 3) * (FARTHEST, FARTHEST, np.pi)
        graph.add(source, target, motion, SURE, closes=True)
    graph.poses = graph.optimum()
