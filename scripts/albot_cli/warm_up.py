"""`albot warm-up`: compile everything in advance, for instance when building a container image."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import re
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click
import numba
from llvmlite import binding as llvm

from albot_cli.outputs import JSON
from albot_cli.progress import progress
from albot_core.files import write_text
from albot_core.kernels import stamp
from albot_core.kernels.simd import padded_length

STEPS = 30
"""Steps of each environment; all of the mapper's code runs in the first few."""
ROBOTS = 2
"""Number of robots in a batch."""
_KERNEL = re.compile(rb"^ *@kernel\(", re.MULTILINE)
WORLD = "square-loop"
HOMING, PLACES = "Albot/Homing-v0", "Albot/PlaceRecognition-v0"
MOVABLE = "random:office:0?rooms=4&people=1&boxes=1&doors=1"
"""A world with all kinds of movables."""


@click.command()
@JSON
def command(as_json: bool) -> None:
    """Compile in advance what environments, mappers, agents and other commands need.

    The compiled code is cached beside the source, in the folder that NUMBA_CACHE_DIR names, or, if
    the sources cannot be written, in a folder of the user, until the package changes. Cached code
    is not compiled again, so a call after an interrupted one continues where that stopped; a call
    after a complete one only checks that the code is still there.
    """
    began, parts = time.monotonic(), dict(_parts())
    with _silence(), _counting() as compiled:
        if not _is_marked(parts):
            missing = max(1, _kernel_count() - len(_indices()))
            with progress("warm-up", len(parts), "parts", every=10.0) as update:
                for done, (name, run) in enumerate(parts.items()):
                    update(done, name, _share(done / len(parts), len(compiled) / missing))
                    run()
                update(len(parts))
            _set_mark(parts)
        seconds = time.monotonic() - began
    if as_json:
        click.echo(json.dumps({"compiled": len(compiled), "seconds": seconds}))
    else:
        click.echo(f"{len(compiled)} functions compiled in {seconds:.0f} s")


def _share(run: float, compiled: float) -> float:
    """Return the share of the time that has passed.

    Almost all time goes into compiling, and most code is compiled in the first parts. Where all was
    compiled before, the parts alone take time.

    Args:
        run: Share of the parts that have run.
        compiled: Share of the missing kernels that have been compiled.
    """
    return run if compiled == 0 else min(1.0, max(run, 0.2 * run + 0.8 * compiled))


def _kernel_count() -> int:
    """Return the number of kernels in our sources."""
    files = (path for folder in _packages() for path in folder.rglob("*.py"))
    return sum(len(_KERNEL.findall(path.read_bytes())) for path in files)


def _parts() -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield name and action of each part. Imports are here: they load the whole simulator."""
    from albot_agents.registry import agent_names
    from albot_agents.task import is_probe, short_name, task_names, untwinned
    from albot_core.mappers.precompile import precompile
    from albot_core.mappers.registry import MAPPERS, NO_MAPPER, installed_mappers

    # The most used parts come first, so that an interrupted call has done the most useful work.
    tasks = [task for task in task_names() if not is_probe(task)]  # They run the same code.
    for task in tasks:
        yield f"a batch for {short_name(task)}", partial(_run_batch, task)
    for task in filter(lambda task: untwinned(task) == task, tasks):  # Twins run the same code.
        for agent in agent_names(task):
            yield f"{agent} at {short_name(task)}", partial(_run_agent, agent, task)
    yield "doors, boxes and people", partial(_run_batch, "Albot/Explore-v0", world=MOVABLE)
    for mapper in (NO_MAPPER, *installed_mappers()):
        needed = frozenset() if mapper == NO_MAPPER else MAPPERS[mapper].sensors
        seen = {"scenes": "ambiguous"} if "scene" in needed else {}
        seen |= {"compass": "clouded"} if "compass" in needed else {}
        yield f"{mapper} in a batch", partial(_run_batch, mapper=mapper, **seen)
        if mapper != NO_MAPPER and "laser" in MAPPERS[mapper].sensors:
            yield mapper, partial(precompile, mapper)


def mark_path() -> Path:
    """Return the file that marks a complete call; it is beside the compiled code."""
    return _kept_code() / "warm-up.json"


def _kept_code() -> Path:
    """Return the folder with the compiled code of the package `albot_core.kernels`.

    It is beside the sources, in NUMBA_CACHE_DIR, or, if the sources cannot be written, in a folder
    of the user.
    """
    kernel: Any = padded_length
    return Path(kernel._cache.cache_path)


def _is_marked(parts: Iterable[str]) -> bool:
    """Return whether the mark is of the same parts and sources, and all compiled code is there."""
    try:
        left = json.loads(mark_path().read_text(encoding="utf-8"))
        return bool(left["of"] == _sources(parts)) and set(left["files"]) <= _indices()
    except (OSError, ValueError, TypeError, KeyError):
        return False


def _set_mark(parts: Iterable[str]) -> None:
    """Write the mark, unless the compiled code is kept elsewhere and cannot be checked."""
    path, files = mark_path(), sorted(_indices())
    if files and os.access(path.parent, os.W_OK):
        write_text(path, json.dumps({"of": _sources(parts), "files": files}))


def _indices() -> set[str]:
    """Return the files with the indices of compiled functions, relative to their folders.

    So a mark holds where the whole project was moved or copied to.
    """
    kept = _kept_code()
    folders = _packages() if kept.name == "__pycache__" else [kept.parent]
    return {
        str(path.relative_to(folder.parent)) for folder in folders for path in folder.rglob("*.nbi")
    }


def _sources(parts: Iterable[str]) -> str:
    """Return a digest of our sources, of numba and the processor, and of the names of all parts."""
    processor = llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()
    summed = hashlib.sha256(repr((numba.__version__, *processor, *parts)).encode())
    for folder in _packages():
        for path in sorted(folder.rglob("*.py")):
            summed.update(path.read_bytes())
    return summed.hexdigest()


def _packages() -> list[Path]:
    """Return the folders of our packages with compiled functions, and of the agents."""
    specs = map(find_spec, (*stamp.PACKAGES, "albot_agents"))
    places = (spec.submodule_search_locations or [] for spec in specs if spec is not None)
    return [Path(place) for found in places for place in found]


def _run_batch(task: str = "Albot/Explore-v0", **settings: Any) -> None:
    """Step a batch with random actions."""
    import gymnasium

    settings = {"world": WORLD, "threads": 1, **_brief(task), **settings}
    envs: Any = gymnasium.make_vec(task, num_envs=ROBOTS, **settings)
    envs.reset(seed=0)
    envs.action_space.seed(0)
    for _ in range(STEPS):
        envs.step(envs.action_space.sample())
    envs.close()


def _brief(task: str) -> dict[str, Any]:
    """Return the settings of a task with which an episode begins after little driving."""
    from albot_env.tasks.homing.outward_journey import OutwardJourneyConfig
    from albot_env.tasks.homing.task import HomingConfig
    from albot_env.tasks.place_recognition.task import PlaceRecognitionConfig
    from albot_env.tasks.place_recognition.tours import TourConfig

    stroll = OutwardJourneyConfig(shortest=1.0, longest=2.0, away=0.0)
    configs = {
        HOMING: HomingConfig(outing=stroll),
        PLACES: PlaceRecognitionConfig(tour=TourConfig(arrivals=3)),
    }
    return {"config": configs[task], "journeys": 1} if task in configs else {}


def _run_agent(agent: str, task: str) -> None:
    """Let an agent act in one single environment."""
    import gymnasium

    from albot_agents.agent import EnvironmentConfigs
    from albot_agents.registry import find_agent
    from albot_cli.episodes import RunningEpisode

    entry = find_agent(agent)
    brief = {} if entry.file is not None and task == PLACES else _brief(task)
    settings = entry.environment(task, {"world": WORLD, "render_mode": "rgb_array", **brief})
    env = gymnasium.make(task, max_episode_steps=STEPS, disable_env_checker=True, **settings)
    driver = entry.make(EnvironmentConfigs.of(env))
    episode = RunningEpisode(env, driver, 0, steps=STEPS)
    while not episode.over:
        episode.advance()
    env.render()
    env.close()


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress the log line about compiling; the progress bar says more."""
    logger = logging.getLogger("albot_core.kernels")
    before = logger.disabled
    logger.disabled = True
    try:
        yield
    finally:
        logger.disabled = before


@contextmanager
def _counting() -> Iterator[list[str]]:
    """Yield a list that collects the names of the kernels compiled in the block."""
    from numba.core import event

    from albot_core.kernels.linking import Kernel

    names: list[str] = []

    class _Compiled(event.Listener):
        def on_start(self, event: Any) -> None:
            if isinstance(event.data["dispatcher"], Kernel):
                names.append(event.data["dispatcher"].py_func.__qualname__)

        def on_end(self, event: Any) -> None:
            """Do nothing."""

    with event.install_listener("numba:compile", _Compiled()):
        yield names
