"""What a mapper makes of an odometer that is far worse: map one real log again and again.

    python scripts/disturbed_odometry.py LOG [--reference FILE] [--mapper NAME] [--runs N]

Every motion is disturbed: its turn by up to 25° to either side, its length by a factor from 0.9 to
1.1, each drawn anew from reading to reading. Prints the ATE of every run, of the corrected poses
where the mapper corrects any, and how many of them are at most `--limit`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from albot_cli.main import exit_status
from albot_cli.map_report import run_mapper, score
from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative
from albot_core.logs.log import Log
from albot_core.logs.reader import read_log, read_reference


def disturbed(log: Log, rng: np.random.Generator, turn: float, scale: float) -> Log:
    """The log with an odometer that errs more.

    Args:
        log: The log.
        rng: Where the errors come from.
        turn: Each turn is off by up to so much (rad).
        scale: Each motion is longer or shorter by up to this share.
    """
    motions = relative(log.odometry[:-1], log.odometry[1:])
    motions[:, :2] *= rng.uniform(1 - scale, 1 + scale, (len(motions), 1))
    motions[:, 2] += rng.uniform(-turn, turn, len(motions))
    poses = [log.odometry[0]]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    return replace(log, odometry=np.array(poses))


@click.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--reference", type=click.Path(path_type=Path))
@click.option("--mapper", default="graph-slam", show_default=True)
@click.option("--runs", default=20, show_default=True)
@click.option("--turn", default=25.0, show_default=True, help="Largest error of a turn (degrees).")
@click.option("--scale", default=0.1, show_default=True, help="Largest share of a length.")
@click.option("--limit", default=0.3, show_default=True, help="ATE (m) that is good enough.")
def main(
    log: Path,
    reference: Path | None,
    mapper: str,
    runs: int,
    turn: float,
    scale: float,
    limit: float,
) -> None:
    """Map LOG with an odometer that is far worse, many times."""
    recorded = read_log(log)
    truth = read_reference(reference) if reference else recorded.reference_trajectory
    if truth is None:
        raise InputError(log, "a reference, in the log or by --reference", "none")
    errors = []
    for seed in range(runs):
        worse = disturbed(recorded, np.random.default_rng(seed), np.radians(turn), scale)
        run = run_mapper(mapper, None, worse, lambda _: None)
        error = score(run.corrected or run.believed, truth, None).trajectory
        if error is None:
            raise InputError(reference or log, "moments of the log", "stamps of another log")
        errors.append(error.rmse)
        click.echo(f"seed {seed}: ATE {error.rmse:.3f} m", err=True)
    good = sum(error <= limit for error in errors)
    click.echo(
        f"{mapper} on {recorded.name}, {runs} runs: ATE median {np.median(errors):.3f} m, "
        f"least {min(errors):.3f}, largest {max(errors):.3f}; at most {limit:g} m in {good}"
    )


if __name__ == "__main__":
    exit_status(main)
