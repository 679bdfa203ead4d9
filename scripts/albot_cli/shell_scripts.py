"""The completion scripts of shells: `--install-completion` and `--show-completion`."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click
from click.shell_completion import get_completion_class

from albot_core.errors import InputError
from albot_core.files import atomic_write, make_folder, read_bytes, write_text

CommandT = TypeVar("CommandT", bound=click.Command)

SHELLS = ("bash", "fish", "zsh")
DETECTED = "detected"
"""Stands for the shell that `SHELL` names."""
_NAME, _VARIABLE = "albot", "_ALBOT_COMPLETE"


def completion_options(command: CommandT) -> CommandT:
    """Add the two options to the command."""
    kinds = click.Choice((*SHELLS, DETECTED))
    for name, callback, text in (
        ("--install-completion", _install, "Let the shell complete names, now and later."),
        ("--show-completion", _show, "Print the shell's completion script."),
    ):
        command.params.append(
            click.Option(
                [name],
                is_flag=False,
                flag_value=DETECTED,
                type=kinds,
                metavar=f"[{'|'.join(SHELLS)}]",
                expose_value=False,
                is_eager=True,
                callback=callback,
                help=f"{text} By default for the shell that SHELL names.",
            )
        )
    return command


@dataclass(frozen=True, kw_only=True)
class _Place:
    """Where a shell finds a completion script."""

    script: Path
    """The script's own file."""
    startup: Path | None = None
    """The shell's start-up file; None where the shell finds the script by itself."""
    line: str = ""
    """The line in it that loads the script."""


def _place(shell: str) -> _Place:
    try:
        home = Path.home()
    except RuntimeError:
        raise InputError("HOME", "the folder of a user", "none") from None
    data = _folder("XDG_DATA_HOME", home / ".local/share")
    if shell == "fish":
        config = _folder("XDG_CONFIG_HOME", home / ".config")
        return _Place(script=config / "fish/completions/albot.fish")
    if shell == "bash":
        # The folder of the package bash-completion, which need not be there: hence the line.
        script = data / "bash-completion/completions/albot"
        return _Place(script=script, startup=home / ".bashrc", line=f"source {_quoted(script)}")
    script = data / "albot/completion.zsh"
    startup = _folder("ZDOTDIR", home) / ".zshrc"
    begin = "(( $+functions[compdef] )) || { autoload -Uz compinit && compinit }"
    return _Place(script=script, startup=startup, line=f"{begin}; source {_quoted(script)}")


def _folder(variable: str, default: Path) -> Path:
    """Return the folder that an environment variable names; a relative one is ignored."""
    named = Path(os.environ.get(variable, ""))
    return named if named.is_absolute() else default


def _quoted(path: Path) -> str:
    text = str(path).replace("'", "'\\''")
    return f"'{text}'"


def _chosen(shell: str) -> str:
    """Return the name of a shell, or that of the user's.

    Raises:
        InputError: The user's shell is none that can complete.
    """
    if shell != DETECTED:
        return shell
    name = Path(os.environ.get("SHELL", "")).name
    if name not in SHELLS:
        expected = f"one of {', '.join(SHELLS)}, or its name behind the option"
        raise InputError("SHELL", expected, name or "nothing")
    return name


def _script(shell: str, command: click.Command) -> str:
    known = get_completion_class(shell)
    assert known is not None
    return known(command, {}, _NAME, _VARIABLE).source()


def _show(context: click.Context, _: click.Parameter, shell: str | None) -> None:
    """Print the script, and exit."""
    if shell is None or context.resilient_parsing:
        return
    click.echo(_script(_chosen(shell), context.command))
    context.exit()


def _install(context: click.Context, _: click.Parameter, shell: str | None) -> None:
    """Write the script to where the shell finds it, tell what was done, and exit."""
    if shell is None or context.resilient_parsing:
        return
    shell = _chosen(shell)
    for done in _written(_place(shell), _script(shell, context.command)):
        click.echo(done)
    click.echo(f"{shell} completes {_NAME} from its next start on")
    context.exit()


def _written(place: _Place, script: str) -> Iterator[str]:
    """Write what is not there yet, and yield what was done to each file."""
    if _content(place.script) == script.encode():
        yield f"unchanged  {place.script}"
    else:
        make_folder(place.script.parent)
        write_text(place.script, script)
        yield f"written    {place.script}"
    if place.startup is None:
        return
    content, line = _content(place.startup), place.line.encode()
    if line in content.splitlines():
        yield f"unchanged  {place.startup}"
        return
    gap = b"\n" if content and not content.endswith(b"\n") else b""
    make_folder(place.startup.parent)
    with atomic_write(place.startup) as stream:
        stream.write(content + gap + line + b"\n")
    yield f"line added {place.startup}"


def _content(path: Path) -> bytes:
    """Return the bytes of a file; none for one that is not there."""
    return read_bytes(path) if path.exists() else b""
