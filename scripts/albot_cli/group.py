"""The group of all subcommands, which are imported only when called."""

from __future__ import annotations

import importlib
import signal
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import click

from albot_cli.main import drop_output
from albot_cli.shell_scripts import completion_options
from albot_cli.signals import handled_signals, use_default_handlers
from albot_core.errors import did_you_mean

_CLOSED_PIPE = 141
"""Exit status after the reader of the output has closed the pipe: that of SIGPIPE."""

SUBCOMMANDS = {
    "agents": "List the agents; write the card of a trained one; draw learning curves.",
    "bench": "Measure speed, each figure beside something run in the same minute.",
    "compare": "Set mappers side by side on the same readings.",
    "config": "Print the configuration of a task.",
    "evaluate": "Measure an agent in many episodes of a task.",
    "export": "Write episodes, maps and logs as files of other programs.",
    "experiment": "Repeat the papers' experiments.",
    "map": "Run a mapper over a real robot's log.",
    "mappers": "List the mapping systems, or print the parameters of one.",
    "play": "Watch an agent at a task, or play an episode back.",
    "results": "Measure all agents in all tasks, for one page.",
    "stress": "Drive agents through many worlds and check every step.",
    "train": "Let an agent learn a task.",
    "warm-up": "Compile in advance all that the other commands need.",
    "worlds": "List, show, check, convert and make worlds.",
}


class LazyGroup(click.Group):
    """A group that imports subcommands only when they are called, to start fast.

    Args:
        package: The package whose modules have the subcommands, each as its `command`.
        summaries: What each subcommand does, by name.
        arguments: See `click.Group`.
    """

    def __init__(self, *, package: str, summaries: Mapping[str, str], **arguments: Any) -> None:
        super().__init__(**arguments)
        self._package, self._summaries = package, summaries

    def make_context(self, *args: Any, **kwargs: Any) -> click.Context:
        """Parse the arguments, or print help."""
        with _until_the_pipe_closes():
            return super().make_context(*args, **kwargs)

    def invoke(self, ctx: click.Context) -> Any:
        """Call the subcommand."""
        with _until_the_pipe_closes():
            return super().invoke(ctx)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the subcommand; for an unknown one, name the most similar.

        click would look for it among the commands that are already imported, and find none.
        """
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            near = did_you_mean(args[0], self._summaries)
            raise click.UsageError(f"{error.format_message()}{near}", ctx) from None

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all subcommands."""
        return sorted(self._summaries)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        """Import the module NAME, with - replaced by _, and return its `command`."""
        if name not in self._summaries:
            return None
        with _default_handlers():
            module = importlib.import_module(f"{self._package}.{name.replace('-', '_')}")
        command: click.Command = module.command
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """List the subcommands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl(sorted(self._summaries.items()))


@completion_options
@click.group(
    cls=LazyGroup,
    package="albot_cli",
    summaries=SUBCOMMANDS,
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.version_option(package_name="albot-env")
def albot() -> None:
    """A robot explores, builds an imprecise map, recognises places and finds its way home."""


@contextmanager
def _until_the_pipe_closes() -> Iterator[None]:
    """Exit without an error message when the reader of the output, such as `head`, has stopped."""
    try:
        yield
    except BrokenPipeError:
        drop_output()
        raise click.exceptions.Exit(_CLOSED_PIPE) from None


@contextmanager
def _default_handlers() -> Iterator[None]:
    """Let signals end the process at once, without output, during the block."""
    before = {number: signal.getsignal(number) for number in handled_signals()}
    use_default_handlers()
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
