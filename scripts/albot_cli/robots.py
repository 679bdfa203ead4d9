"""The option `--robot` of commands that drive."""

from __future__ import annotations

import click

robot_option = click.option(
    "--robot",
    help="Body and drive: pioneer-3dx, kobuki or peoplebot. Worlds are checked for it.  "
    "[default: the agent's own, or pioneer-3dx]",
)
