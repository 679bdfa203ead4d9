"""The `albot` command: finds the subcommand, and turns errors into exit statuses."""

from __future__ import annotations

import errno
import importlib
import os
import sys
from contextlib import suppress
from pathlib import Path

import click

from albot_core.errors import InputError

SUBCOMMANDS = {
    "agents": "List the agents; write the model card of a trained one.",
    "bench": "Measure speed, each figure beside something run in the same minute.",
    "evaluate": "Measure an agent in many episodes of a task.",
    "experiment": "Repeat the papers' experiments.",
    "map": "Run a mapper over a real robot's log.",
    "mappers": "List the mapping systems.",
    "play": "Watch a robot explore and map, or play an episode back.",
    "results": "Measure all agents in all tasks, for one page.",
    "stress": "Drive agents through many worlds and check every step.",
    "train": "Let an agent learn a task.",
    "worlds": "List, show, check, convert and make worlds.",
}

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""What the system says where a disk, or whatever takes the output, is full or broken."""


class LazyGroup(click.Group):
    """A group whose subcommands are imported only when they are called, to start fast."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The names of all subcommands."""
        return sorted(SUBCOMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import `albot_cli.NAME` and return its `command`."""
        if name not in SUBCOMMANDS:
            return None
        module = importlib.import_module(f"albot_cli.{name}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(sorted(SUBCOMMANDS.items()))


@click.group(cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="albot-env")
def albot() -> None:
    """A robot explores, builds an imprecise map, recognises places and finds its way home."""


def main() -> None:
    """Run the command: exit status 0 done, 2 bad input, 1 our own fault."""
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
        # A stream that the caller has closed (`>&-`) is None.
        sys.stdout = sys.stdout or nowhere
        sys.stderr = sys.stderr or nowhere
        exit_status(albot)


def exit_status(command: click.Command) -> None:
    """Run a command and leave with its exit status; bad input is one line on stderr."""
    try:
        status = command.main(standalone_mode=False)
    except InputError as error:
        click.echo(f"albot: {error}", err=True)
        sys.exit(2)
    except click.ClickException as error:
        message = error.format_message()
        # A group that is called without a subcommand shows its help.
        click.echo(message if message.startswith("Usage:") else f"albot: {message}", err=True)
        sys.exit(2)
    except click.Abort:
        click.echo("albot: stopped", err=True)
        sys.exit(130)
    except OSError as error:
        if error.errno not in _NO_ROOM:
            raise
        click.echo(f"albot: cannot write: {error.strerror}", err=True)
        _drop_output()
        sys.exit(1)
    sys.exit(status if isinstance(status, int) else 0)


def _drop_output() -> None:
    """Let what cannot be written go, or Python would try and fail once more when it ends."""
    with Path(os.devnull).open("w", encoding="utf-8") as nowhere, suppress(OSError):
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


if __name__ == "__main__":
    main()
