"""Where nothing is compiled yet, two processes compile at the same time.

numba compiles one function at a time in a process. So the mapper, which is about half of it, gets a
process of its own: `python -m albot_core.mappers.precompile`. Meanwhile robots that have no mapper
let all else be compiled here. What one process has compiled the other finds on disk.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from multiprocessing import parent_process

import numpy as np

from albot_core.kernels.linking import Kernel
from albot_env.sim.sensing import sense
from albot_env.sim.thread_pool import processors
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.robots import BatchedRobots
from albot_env.tasks.core.settings import NO_MAPPER, Equipment
from albot_maps import load_world

WORLD = "square-loop"


def precompile(equipment: Equipment) -> None:
    """Compile what a mapper and its robots need, each in a process, if nothing is compiled yet.

    Does nothing where there is one processor or no mapper, in worker processes, and where no
    process can be started: then each function is compiled when it is first called.
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
            _run_robots(replace(equipment, mapper=NO_MAPPER, mapper_config=None, threads=1))
            process.wait()
        finally:
            process.kill()  # Where this was interrupted; one that has ended stays as it is.


def is_compiled() -> bool:
    """Whether an environment has run since the kernels last changed."""
    compiled = sense.compiled
    return not isinstance(compiled, Kernel) or compiled.is_compiled


def _run_robots(equipment: Equipment) -> None:
    """Let a robot take a step."""
    world = load_world(WORLD)
    robots = BatchedRobots(1, equipment, actions=ActionConfig(), observations=ObservationConfig())
    robots.begin(0, world, world.starts[0], np.random.default_rng(0))
    robots.observe()
    robots.drive(np.zeros((1, 2)))
    robots.observe()
    robots.close()
