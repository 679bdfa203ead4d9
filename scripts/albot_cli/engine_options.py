"""The options that say where the many independent tasks of a command run."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import click

from albot_cli.count_type import CountType

_Command = TypeVar("_Command", bound=Callable[..., Any])


def engine_options(command: _Command) -> _Command:
    """Add the options; the command gets the engine as `engine`, which is closed when it returns."""

    @wraps(command)
    def with_engine(*arguments: Any, jobs: int | None, **options: Any) -> Any:
        from albot_agents.engine import choice  # Slow to load, as all of the package.

        with choice.make_engine(workers=jobs) as engine:
            return command(*arguments, engine=engine, **options)

    add = click.option("--jobs", type=CountType(1), help="Processes.  [default: one a core]")
    return cast(_Command, add(with_engine))
