"""`albot mappers`: list the mapping systems and their parameters. Also reads `--mapper-config`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from albot_cli import completion
from albot_cli.config import parameter_rows
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_core.config_document import to_yaml
from albot_core.errors import InputError
from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.registry import MAPPERS, mapper_config, mapper_spec
from albot_core.plain_data import Location
from albot_core.yaml_document import read_yaml

mapper_config_option = click.option(
    "--mapper-config",
    type=PathType(dir_okay=False),
    help="YAML file with mapper parameters that override the defaults, as `albot mappers NAME` "
    "prints them.",
)


@click.command()
@click.argument("name", required=False, shell_complete=completion.mapper_names)
@JSON
def command(name: str | None, as_json: bool) -> None:
    """List the mapping systems, or print the parameters of the one called NAME as YAML.

    The list tells what each does and where it is described. The parameters come with default, unit,
    range and meaning; change the file and give it to --mapper-config.
    """
    if name is not None:
        spec = mapper_spec(name)
        config = mapper_config(spec)
        if as_json:
            click.echo(json.dumps({**_facts(spec), "parameters": parameter_rows(config)}))
            return
        heading = (
            f"The parameters of {spec.name}: {spec.summary}\n{spec.paper}.\n"
            "For --mapper-config. What is left out stays as it is here; None is written null."
        )
        click.echo(to_yaml(config, heading), nl=False)
        return
    if as_json:
        click.echo(json.dumps({"mappers": [_facts(entry) for entry in MAPPERS.values()]}))
        return
    width = max(map(len, MAPPERS))
    for entry in MAPPERS.values():
        click.echo(f"{entry.name:<{width}}  {entry.summary}")
        click.echo(f"{'':<{width}}  {entry.paper}")


def _facts(spec: MapperSpec) -> dict[str, Any]:
    facts = {"name": spec.name, "summary": spec.summary, "paper": spec.paper}
    return {**facts, "sensors": sorted(spec.sensors), "layers": list(spec.layers)}


def read_robots_config(mapper: str, path: Path) -> Any:
    """Read the parameters of an environment's mapper, given by name, from a YAML file.

    Raises:
        InputError: The mapper is `none`; or as for `read_mapper_config`.
    """
    from albot_core.mappers.registry import NO_MAPPER

    if mapper == NO_MAPPER:
        expected = f"no such option for a robot without a mapper (--mapper {NO_MAPPER})"
        raise InputError("--mapper-config", expected, str(path))
    return read_mapper_config(mapper_spec(mapper), path)


def read_mapper_config(spec: MapperSpec, path: Path | None) -> Any:
    """Read a mapper's parameters from a YAML file; return the defaults if `path` is None.

    Raises:
        InputError: The file is not a YAML mapping, or has a key that is not a parameter of the
            mapper or an invalid value; the message names the line.
    """
    if path is None:
        return mapper_config(spec)
    document = read_yaml(path)
    return mapper_config(spec, document.data, Location(path, place=document.place))
