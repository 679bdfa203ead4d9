"""`albot config`: print a task's configuration. Also reads `--config` of other commands."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import click

from albot_cli import completion
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_core.config_document import parameters, to_yaml
from albot_core.plain_data import Location, read_config, to_plain
from albot_core.yaml_document import dotted, format_value, read_yaml

config_option = click.option(
    "--config",
    type=PathType(dir_okay=False),
    help="YAML file with parameters of the task that override the defaults, as `albot config TASK` "
    "prints them. A trained agent's observations and actions stay its own.",
)


@click.command()
@click.argument("task", shell_complete=completion.task_names)
@JSON
def command(task: str, as_json: bool) -> None:
    """Print the configuration of TASK as YAML: each parameter, its default, unit and range.

    Change the file and give it to --config of `albot play` or `albot evaluate`. What it leaves out
    stays as it is here.
    """
    from albot_agents.task import config_kind, find_task

    task = find_task(task)
    default = config_kind(task)()
    if as_json:
        click.echo(json.dumps({"task": task, "parameters": parameter_rows(default)}))
        return
    heading = (
        f"The configuration of {task}.\n"
        "For --config of `albot play` and `albot evaluate`, and for env.config in the plans of "
        "`albot train`. What is left out stays as it is here; None is written null."
    )
    click.echo(to_yaml(default, heading), nl=False)


def parameter_rows(config: Any) -> list[dict[str, Any]]:
    """Return name, default, range and meaning of all parameters of a configuration, for JSON."""
    rows = []
    for parameter in parameters(config):
        value = to_plain(parameter.value)
        if isinstance(value, float) and not math.isfinite(value):  # JSON has no infinity.
            value = format_value(value)
        row = {"name": dotted(parameter.path), "default": value, "range": parameter.allowed}
        if parameter.allowed:  # A group's parameters have rows of their own.
            rows.append({**row, "meaning": parameter.meaning})
    return rows


def read_task_config(task: str, path: Path) -> Any:
    """Read a task's configuration from a YAML file of the parameters that differ from the defaults.

    Raises:
        InputError: The file is not a YAML mapping, or has an unknown key or an invalid value; the
            message names the line.
    """
    from albot_agents.task import config_kind

    document = read_yaml(path)
    return read_config(config_kind(task), document.data, Location(path, place=document.place))
