"""The option `--robot` of commands that drive."""

from __future__ import annotations

import click

from albot_cli.completion import ROBOTS, listed, robot_names
from albot_core.errors import InputError, did_you_mean


def _known(ctx: click.Context, parameter: click.Parameter, name: str | None) -> str | None:
    """Return the name of a robot, or None.

    Raises:
        InputError: There is no such robot.
    """
    if name is not None and name not in ROBOTS:
        expected, found = f"one of {', '.join(ROBOTS)}", f"{name!r}{did_you_mean(name, ROBOTS)}"
        raise InputError("--robot", expected, found)
    return name


robot_option = click.option(
    "--robot",
    shell_complete=robot_names,
    callback=_known,
    help=f"Body and drive: {listed(ROBOTS)}. Worlds are checked for it.  "
    "[default: the agent's own, or pioneer-3dx]",
)
