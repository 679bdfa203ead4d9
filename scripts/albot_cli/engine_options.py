"""The options that say where the many independent tasks of a command run."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import click

from albot_cli.number_types import CountType

_Command = TypeVar("_Command", bound=Callable[..., Any])


def engine_options(command: _Command) -> _Command:
    """Add the options; the command gets the engine as `engine`, which is closed when it returns."""

    @wraps(command)
    def with_engine(
        *arguments: Any, engine: str, address: str | None, jobs: int | None, **options: Any
    ) -> Any:
        from albot_agents.engine import choice  # Slow to load, as all of the package.

        with choice.make_engine(engine, jobs, address) as made:
            return command(*arguments, engine=made, **options)

    with_options: Callable[..., Any] = with_engine
    for option in reversed(_OPTIONS):
        with_options = option(with_options)
    return cast(_Command, with_options)


ENGINE = click.option(
    "--engine",
    type=click.Choice(["local", "ray"]),
    default="local",
    show_default=True,
    help="Processes of this machine, or Ray (extra `cluster`; docs/scaling.md). The results are "
    "the same.",
)
ADDRESS = click.option(
    "--address",
    metavar="HOST:PORT",
    help="With --engine ray: the head of a cluster, or auto.  [default: this machine alone]",
)
_OPTIONS = (
    click.option("--jobs", type=CountType(1), help="Tasks at a time.  [default: one a core]"),
    ENGINE,
    ADDRESS,
)
