"""`albot mappers`: the mapping systems, and what other commands take of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.registry import MAPPERS, mapper_config
from albot_core.plain_data import Location
from albot_core.yaml_document import read_yaml


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def command(as_json: bool) -> None:
    """List the mapping systems, what each does and where it is described."""
    if as_json:
        click.echo(
            json.dumps(
                {
                    "mappers": [
                        {
                            "name": entry.name,
                            "summary": entry.summary,
                            "paper": entry.paper,
                            "sensors": sorted(entry.sensors),
                            "layers": list(entry.layers),
                        }
                        for entry in MAPPERS.values()
                    ]
                }
            )
        )
        return
    width = max(map(len, MAPPERS))
    for entry in MAPPERS.values():
        click.echo(f"{entry.name:<{width}}  {entry.summary}")
        click.echo(f"{'':<{width}}  {entry.paper}")


def read_mapper_config(spec: MapperSpec, path: Path | None) -> Any:
    """A mapper's thresholds from a YAML file; the default ones where none is given.

    Raises:
        InputError: The file is no YAML mapping, or holds a key that is no threshold of the mapper,
            or a value that it does not take; the message names the line.
    """
    if path is None:
        return mapper_config(spec)
    document = read_yaml(path)
    return mapper_config(spec, document.data, Location(path, place=document.place))
