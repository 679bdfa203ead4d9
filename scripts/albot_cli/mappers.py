"""`albot mappers`: the mapping systems."""

from __future__ import annotations

import json

import click

from albot_core.mappers.registry import MAPPERS


@click.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else.")
def command(as_json: bool) -> None:
    """List the mapping systems, what each does and where it is described."""
    if as_json:
        click.echo(
            json.dumps(
                {
                    "mappers": [
                        {"name": entry.name, "summary": entry.summary, "paper": entry.paper}
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
