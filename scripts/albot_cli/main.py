"""The `albot` command: turns errors and signals into exit statuses.

All but the next to nothing above is imported within functions, once Ctrl-C finds us prepared.
"""

from __future__ import annotations

import os
import sys

from albot_cli.signals import STOPPED, Interrupts, die_quietly

TYPE_CHECKING = False  # As typing's, which would have to be loaded.
if TYPE_CHECKING:
    import click


def main() -> None:
    """Run the command.

    Exit status 0 done, 2 bad input, 1 our own fault, 128 + n where signal n ended it, and so 141
    (SIGPIPE) where nobody reads any longer what it prints.
    """
    die_quietly()
    with open(os.devnull, "w", encoding="utf-8") as nowhere:  # noqa: PTH123
        # A stream that the caller has closed (`>&-`) is None.
        sys.stdout = sys.stdout or nowhere
        sys.stderr = sys.stderr or nowhere
        from albot_cli.group import albot

        exit_status(albot)


def exit_status(command: click.Command) -> None:
    """Run a command and leave with its exit status; bad input is one line on stderr."""
    interrupts = Interrupts()
    try:
        interrupts.listen()
        returned = command.main(standalone_mode=False)
        status = returned if isinstance(returned, int) else 0
        die_quietly()
    except BaseException as error:  # noqa: BLE001 - an interrupt may come out as any error
        die_quietly()
        status = _tell(error, interrupts)
    sys.exit(interrupts.status if status == STOPPED else status)


def _tell(error: BaseException, interrupts: Interrupts) -> int:
    """Say what has ended the command; the exit status. What is nobody's input is raised again."""
    import errno

    import click

    from albot_core.errors import InputError

    if interrupts.heard is not None or isinstance(error, click.Abort):
        _say("albot: stopped")  # Even if the interrupt came out of some library as another error.
        return STOPPED
    if isinstance(error, InputError):
        _say(f"albot: {error}")
        return 2
    if isinstance(error, click.ClickException):
        message = error.format_message()
        # A group that is called without a subcommand shows its help.
        _say(message if message.startswith("Usage:") else f"albot: {message}")
        return 2
    # What the system says where a disk, or whatever takes the output, is full or broken.
    no_room = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
    if isinstance(error, OSError) and error.errno in no_room:
        where = error.filename or "what is printed"
        _say(f"albot: cannot write {where}: {error.strerror}")
        drop_output()
        return 1
    raise error


def _say(text: str) -> None:
    from contextlib import suppress

    import click

    with suppress(OSError):  # The terminal may be gone.
        click.echo(text, err=True)


def drop_output() -> None:
    """Let what cannot be written go, or Python would try and fail once more when it ends."""
    from contextlib import suppress

    with open(os.devnull, "w", encoding="utf-8") as nowhere, suppress(OSError):  # noqa: PTH123
        os.dup2(nowhere.fileno(), sys.stdout.fileno())


if __name__ == "__main__":
    main()
