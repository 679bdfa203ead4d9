"""The page of the command line, read from the command itself."""

from __future__ import annotations

import inspect
from collections.abc import Iterator

import click

from albot_cli.group import albot
from albot_site.markdown import cell, code_cell, fenced, table


def command_line_page() -> str:
    """Return the page that tells of each subcommand what its `--help` tells."""
    context = click.Context(albot, info_name="albot")
    parts = ["# The command line\n", f"{albot.help}\n"]
    parts += ["Exit status: 0 done, 2 bad input or a full disk, 1 our fault.\n"]
    for name in albot.list_commands(context):
        command = albot.get_command(context, name)
        assert command is not None
        parts += _sections(click.Context(command, info_name=name, parent=context), 2)
    return "\n".join(parts)


def _sections(context: click.Context, level: int) -> Iterator[str]:
    """Yield the sections of a command and its subcommands."""
    command = context.command
    usage = " ".join(command.collect_usage_pieces(context))
    yield f"{'#' * level} {context.command_path}\n"
    yield fenced(f"{context.command_path} {usage}", "text")
    yield _text(inspect.cleandoc(command.help or ""))
    options = [each for each in command.get_params(context) if isinstance(each, click.Option)]
    rows = [_row(option, context) for option in options if "--help" not in option.opts]
    yield table(("option", "", "default"), rows)
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from _sections(
                click.Context(inner, info_name=name, parent=context), min(level + 1, 4)
            )


def _text(text: str) -> str:
    r"""Return a help text as markdown; `\b` marks lines that click leaves as they are."""
    parts = []
    for paragraph in text.strip().split("\n\n"):
        _, kept, lines = paragraph.partition("\b\n")
        parts.append(fenced(lines, "text") if kept else paragraph + "\n")
    return "\n".join(parts).replace("\f", "")


def _row(option: click.Option, context: click.Context) -> tuple[str, str, str]:
    record = option.get_help_record(context)
    names = record[0] if record else ", ".join(option.opts)
    default = option.get_default(context, call=False)
    shown = "" if _is_unset(option, default) else default
    return code_cell(names), cell(option.help or ""), code_cell(shown)


def _is_unset(option: click.Option, default: object) -> bool:
    """Return whether an option has no default to tell of."""
    told = isinstance(default, bool | int | float | str)
    return not told or option.is_flag or default == ""
