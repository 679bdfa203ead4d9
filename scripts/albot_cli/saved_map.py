"""The option `--saved-map` of commands that drive."""

from __future__ import annotations

import click

saved_map_option = click.option(
    "--saved-map",
    metavar="MAPFILE",
    help="A map of the mapper, begun at the world's first start (`albot map --out`): the robot "
    "localises itself in it, and home is there.",
)
