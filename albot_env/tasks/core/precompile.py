"""Compilation by two processes at once, if nothing is compiled yet.

numba compiles one function at a time per process. The mapper is about half of all code, so it is
compiled in its own process: `python -m albot_core.mappers.precompile`. Meanwhile this process
compiles the rest by running robots without a mapper. Both share their results on disk.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from multiprocessing import parent_process

import numpy as np

from albot_core.kernels.linking import Kernel
from albot_core.mappers.registry import NO_MAPPER
from albot_env.sim.sensing import sense
from albot_env.sim.thread_pool import processors
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.settings import Equipment
from albot_maps import load_world

WORLD = "square-loop"


def precompile(equipment: Equipment) -> None:
    """Compile the kernels of the mapper and of the robots in two processes, if necessary.

    Does nothing if kernels are compiled, with one processor or no mapper, in worker processes, and
    if no process can be started. Each function is then compiled at its first call.
    """
    if is_compiled() or equipment.mapper == NO_MAPPER or processors() < 2 or parent_process():
        return
    command = (sys.executable, "-m", "albot_core.mappers.precompile", equipment.mapper)
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
    except OSError:
        return
    with process:
        try:
            _run_robots(
                replace(
                    equipment,
                    mapper=NO_MAPPER,
                    mapper_config=None,
                    saved_map=None,
                    extend_map=False,
                    threads=1,
                )
            )
            process.wait()
        finally:
            process.kill()  # Stops it after an interrupt; has no effect if it has ended.


def is_compiled() -> bool:
    """Return whether an environment has run since the kernels last changed."""
    compiled = sense.compiled
    return not isinstance(compiled, Kernel) or compiled.is_compiled


def _run_robots(equipment: Equipment) -> None:
    """Run one robot for a step."""
    world = load_world(WORLD)
    robots = DrivingTask(1, equipment, actions=ActionConfig(), observations=ObservationConfig())
    robots.begin(0, world, world.starts[0], np.random.default_rng(0))
    robots.observe()
    robots.drive(np.zeros((1, 2)))
    robots.observe()
    robots.close()
