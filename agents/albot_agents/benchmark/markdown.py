"""Pieces of text that all sections of the page of results are made of."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator

from albot_agents.benchmark.table import Estimate
from albot_core.mappers.registry import NO_MAPPER

FEWEST = 20
"""Fewest episodes from which a sentence is made, each another one of the protocol."""
_WIDTH = 100
"""Most characters of a line of text."""


def paragraph(text: str) -> Iterator[str]:
    """Yield an empty line and the lines of a paragraph; nothing for an empty one."""
    if text:
        yield ""
        yield from textwrap.wrap(text, _WIDTH, break_long_words=False, break_on_hyphens=False)


def agent_text(agent: str, mapper: str) -> str:
    """Return an agent's name with its mapper."""
    return f"`{agent}`" if mapper == NO_MAPPER else f"`{agent}` ({mapper})"


def written(estimate: Estimate | None, form: str, *, interval: bool = True) -> str:
    """Return a figure with its interval; a dash if there is none.

    Args:
        estimate: The figure.
        form: Its format; with a sign, the interval is written with `to`.
        interval: Whether its interval is shown.
    """
    if estimate is None:
        return "–"
    text = form.format(estimate.value)
    if interval:
        low, high = map(form.format, estimate.ci95)
        text += f" ({low}{' to ' if '+' in form else '–'}{high})"
    return text
