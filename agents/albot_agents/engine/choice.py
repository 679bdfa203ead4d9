"""Choose an engine by its name."""

from __future__ import annotations

import importlib.util
import os

from albot_agents.engine.engine import Engine
from albot_agents.engine.local import LocalEngine
from albot_core.errors import InputError, did_you_mean

LOCAL, RAY = "local", "ray"
ENGINES = (LOCAL, RAY)
"""The names of the engines."""
EXTRA = "pip install -c constraints.txt '.[cluster]' in a clone"
"""How the extra `cluster` is installed."""


def make_engine(
    name: str = LOCAL, workers: int | None = None, address: str | None = None
) -> Engine:
    """Return an engine, which starts nothing before it is used.

    Args:
        name: One of `ENGINES`.
        workers: Number of tasks at a time; None for one a core, of this machine or of the cluster.
        address: Address of the head of a Ray cluster; None to start one of this machine alone.

    Raises:
        InputError: There is no such engine, it has no address, or Ray is not installed.
    """
    if name not in ENGINES:
        raise InputError("--engine", " or ".join(ENGINES), f"{name}{did_you_mean(name, ENGINES)}")
    if name == LOCAL:
        if address is not None:
            raise InputError("--address", f"--engine {RAY}, which has a cluster", name)
        return LocalEngine(workers or os.cpu_count() or 1)
    if importlib.util.find_spec("ray") is None:
        expected = f"the package of the extra `cluster` ({EXTRA})"
        raise InputError(f"--engine {RAY}", expected, "no ray")
    from albot_agents.engine.ray_cluster import RayEngine

    return RayEngine(address, workers)
