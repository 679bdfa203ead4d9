"""The option `--faults` of commands that drive."""

from __future__ import annotations

import click

from albot_cli.completion import fault_names

faults_option = click.option(
    "--faults",
    metavar="SPEC",
    shell_complete=fault_names,
    help="What goes wrong: NAME or NAME:KEY=VALUE,…, joined by +, as "
    "laser-dropout+kidnap:at=20m (docs/faults.md).",
)
