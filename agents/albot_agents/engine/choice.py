"""Choose an engine by its name."""

from __future__ import annotations

import os

from albot_agents.engine.engine import Engine
from albot_agents.engine.local import LocalEngine
from albot_core.errors import InputError, did_you_mean

LOCAL = "local"
ENGINES = (LOCAL,)
"""The names of the engines."""


def make_engine(name: str = LOCAL, workers: int | None = None) -> Engine:
    """Return an engine, which starts nothing before it is used.

    Args:
        name: One of `ENGINES`.
        workers: Number of tasks at a time; None for one a core.

    Raises:
        InputError: There is no such engine.
    """
    if name not in ENGINES:
        raise InputError("--engine", " or ".join(ENGINES), f"{name}{did_you_mean(name, ENGINES)}")
    return LocalEngine(workers or os.cpu_count() or 1)
