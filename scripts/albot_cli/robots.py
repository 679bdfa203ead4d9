"""The option `--robot` of commands that drive."""

from __future__ import annotations

import click

from albot_cli.completion import ROBOTS, listed, robot_names

robot_option = click.option(
    "--robot",
    shell_complete=robot_names,
    help=f"Body and drive: {listed(ROBOTS)}. Worlds are checked for it.  "
    "[default: the agent's own, or pioneer-3dx]",
)
