"""The options by which a command writes a row a task, and goes on after any end."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

import click

from albot_cli.path_type import PathType
from albot_core.errors import InputError

_HOW = ("--resume", "--engine", "--address", "--jobs", "--json")
"""Options that say how a run is run, which may differ when it is resumed."""

ROWS = click.option(
    "--rows",
    type=PathType(file_okay=False),
    help="New folder for a row an episode, written as they come: Parquet with the extra `cluster`, "
    "JSON lines without it.",
)
RESUME = click.option(
    "--resume",
    type=PathType(file_okay=False),
    help="Go on with the run of this folder of --rows, with its options, however it ended.",
)


class ResumableCommand(click.Command):
    """A command with `ROWS` and `RESUME`, which takes the other options of a run from its folder.

    In the context, `words` are the arguments of the run without those that say how it is run.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments, and those of the run that is resumed."""
        folder = self._resumed(args)
        if folder is None:
            ctx.meta[__name__] = self._split(args)[1]
            return super().parse_args(ctx, args)
        from albot_agents.engine.rows import Manifest

        how, others = self._split(args, resumes=True)
        if others:
            kind = "option" if others[0].startswith("-") else "argument"
            expected = f"no such {kind} with --resume, whose run has its own"
            raise InputError(others[0].partition("=")[0], expected)
        words = list(Manifest.read(folder, str(ctx.info_name)).words)
        ctx.meta[__name__] = words
        return super().parse_args(ctx, [*words, *how])

    def _split(self, args: list[str], *, resumes: bool = False) -> tuple[list[str], list[str]]:
        """Return the arguments that say how a run is run, and the others.

        The place of a new run's rows is none of either.
        """
        how: list[str] = []
        others: list[str] = []
        options = {name: each for each in self.params for name in each.opts}
        left = iter(args)
        for word in left:
            name = word.partition("=")[0]
            option = options.get(name)
            value = [next(left, "")] if _takes_next(option, word) else []
            if name != "--rows" or resumes:
                (how if name in _HOW else others).extend([word, *value])
        return how, others

    def _resumed(self, args: list[str]) -> Path | None:
        """Return the folder that `--resume` names."""
        for k, word in enumerate(args):
            if word == "--resume" and k + 1 < len(args):
                return Path(args[k + 1])
            if word.startswith("--resume="):
                return Path(word.partition("=")[2])
        return None


def _takes_next(option: Any, word: str) -> bool:
    """Return whether the word after an option is its value."""
    return isinstance(option, click.Option) and not option.is_flag and "=" not in word


def words_of(ctx: click.Context) -> list[str]:
    """Return the arguments of a `ResumableCommand`'s run."""
    words: list[str] = ctx.meta[__name__]
    return words


def continued(ctx: click.Context, place: Path | None) -> list[str]:
    """Return the lines that tell how a stopped run goes on."""
    if place is None:
        return []
    return [f"  continue with: albot {ctx.info_name} --resume {shlex.quote(str(place))}"]


def rows_place(rows: Path | None, resume: Path | None) -> tuple[Path | None, bool]:
    """Return the folder of the rows, or None, and whether its run is resumed."""
    return (rows if resume is None else resume), resume is not None
