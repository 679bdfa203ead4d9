"""The `albot` command: turns errors and signals into exit statuses.

Other imports are within functions, so that signals are handled before they load.
"""

from __future__ import annotations

import os
import sys

from albot_cli.signals import STOPPED, Interrupts, use_default_handlers

TYPE_CHECKING = False  # Like typing.TYPE_CHECKING, without loading typing.
if TYPE_CHECKING:
    import click


def main() -> None:
    """Run the command.

    The exit status is 0 for success, 2 for what the user can mend (bad input, a full disk), 1 for
    a bug, 128 + n if signal n ended the command, and so 141 (SIGPIPE) if the reader of the output
    has closed the pipe.
    """
    use_default_handlers()
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # noqa: PTH123
        # A stream closed by the caller (`>&-`) is None.
        sys.stdout = sys.stdout or nowhere
        sys.stderr = sys.stderr or nowhere
        from albot_cli.group import albot
        from albot_core.garbage import collect_rarely

        collect_rarely()
        exit_status(albot)


def exit_status(command: click.Command) -> None:
    """Run a command and exit with its status; bad input and a full disk print one line."""
    interrupts = Interrupts()
    try:
        interrupts.listen()
        returned = command.main(standalone_mode=False)
        status = returned if isinstance(returned, int) else 0
        interrupts.end()
    except BaseException as error:  # noqa: BLE001 - an interrupt may come out as any error
        interrupts.end()
        status = _report_error(error, interrupts)
    sys.exit(interrupts.status if status == STOPPED else status)


def _report_error(error: BaseException, interrupts: Interrupts) -> int:
    """Report what ended the command, and return the exit status; re-raise other errors."""
    import errno

    import click

    from albot_core.errors import InputError

    if interrupts.heard is not None or isinstance(error, click.Abort):
        _print_error("albot: stopped")  # Even if a library turned the interrupt into another error.
        return STOPPED
    if isinstance(error, InputError):
        _print_error(f"albot: {error}")
        return 2
    if isinstance(error, click.ClickException):
        message = error.format_message()
        if isinstance(error, click.MissingParameter):  # It lists the choices line by line.
            message = " ".join(message.split())
        # A group called without a subcommand shows its help.
        _print_error(message if message.startswith("Usage:") else f"albot: {message}")
        return 2
    # Errors of a full or broken disk or output device.
    no_room = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
    if isinstance(error, OSError) and error.errno in no_room:
        where = error.filename or "what is printed"
        _print_error(f"albot: cannot write {where}: {error.strerror}")
        drop_output()
        return 2
    raise error


def _print_error(text: str) -> None:
    from contextlib import suppress

    import click

    with suppress(OSError):  # The terminal may be gone.
        click.echo(text, err=True)


def drop_output() -> None:
    """Discard pending output, which Python would otherwise try to write again at exit."""
    from contextlib import suppress

    with open(os.devnull, "w", encoding="utf-8") as nowhere, suppress(OSError):  # noqa: PTH123
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


if __name__ == "__main__":
    main()
