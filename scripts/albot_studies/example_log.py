"""The small log that comes with the project: a simulated robot that explores an office."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import click
import numpy as np

from albot_cli.explored_logs import Exploration, explore
from albot_cli.outputs import FORCE, check_file
from albot_cli.path_type import PathType
from albot_core.export.carmen import write_carmen
from albot_core.geometry.poses import relative
from albot_core.logs.example import EXAMPLE
from albot_core.logs.log import Log

EXPLORATION = Exploration(
    world="office-ring",
    seed=2,
    agent="gap-explorer",
    steps=1800,
    sensors={"odometer": "poor"},
)
SPACING, TURN = 0.4, np.radians(20.0)
"""A scan is kept once the robot has moved this far (m), or turned this much (rad), since the last
that was."""


@click.command()
@click.option("--out", type=PathType(dir_okay=False), default=EXAMPLE, help="The file.")
@FORCE
def command(out: Path, force: bool) -> None:
    """Make the log that `albot map` maps where no other is named."""
    check_file(out, force=force)
    write_carmen(kept(explore(EXPLORATION)), out)
    click.echo(str(out))


def kept(log: Log) -> Log:
    """Return a log with only the scans that lie apart."""
    scans = [0]
    for scan, pose in enumerate(log.odometry):
        since = relative(log.odometry[scans[-1]], pose)
        if np.hypot(*since[:2]) >= SPACING or abs(since[2]) >= TURN:
            scans.append(scan)
    return replace(log.with_scans(np.array(scans)), name="example", notes=())
