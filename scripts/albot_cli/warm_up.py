"""Compiling what an episode runs, the first time that one is run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click


def warm_up(mapper: str) -> None:
    """Where nothing is compiled yet, compile the mapper and all else at the same time.

    numba compiles one function at a time in a process, so the mapper gets a process of
    its own. Without this an episode runs just as well, and its first steps take longer.
    """
    import gymnasium

    from albot_env.sim.sensing import sense
    from albot_env.tasks.core.settings import NO_MAPPER
    from albot_env.tasks.explore.env import ENVIRONMENT

    if _is_compiled(sense.compiled):
        return
    click.echo("albot: compiling, for the first time only", err=True)
    command = [sys.executable, "-m", "albot_core.kernels.precompile", mapper]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        try:
            env = gymnasium.make(ENVIRONMENT, world="square-loop", mapper=NO_MAPPER)
            env.reset(seed=0)
            env.step(env.action_space.sample())
            env.close()
            process.wait()
        finally:
            process.kill()  # Where this was interrupted; one that has ended stays as it is.


def _is_compiled(function: object) -> bool:
    """Whether numba has kept a compiled form of a function, of this version or an older one."""
    name = getattr(function, "__qualname__", "")
    folder = Path(function.stats.cache_path)  # type: ignore[attr-defined]
    return any(folder.glob(f"*.{name}-*.nbi"))
