"""`python -m albot_reliability`: the page on reliability, and digests of all results."""

from __future__ import annotations

import click

from albot_cli.group import LazyGroup
from albot_cli.main import exit_status

PROGRAMS = {
    "digests": "Write digests of all that comes out, or compare with those written before.",
    "fuzz": "Give damaged files to all readers for some minutes, and keep those that crash one.",
    "mutations": "Break the papers' mechanisms one by one, and tell which checks see it.",
    "page": "Try to break the project, and write docs/reliability.md.",
}


@click.group(cls=LazyGroup, package="albot_reliability", summaries=PROGRAMS)
def main() -> None:
    """Run a program for developers; call it in the project's folder."""


if __name__ == "__main__":
    exit_status(main)
