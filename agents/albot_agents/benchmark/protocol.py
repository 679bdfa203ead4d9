"""The protocol of the benchmark: tasks, worlds, odometers, seeds, budgets.

A protocol is a file of the package, `protocol_1.yml`. What an agent meets in a cell of the table
follows from it alone: the worlds, and in each the seeds of the episodes. It is frozen with the
worlds' digests, so that a changed generator or another floor plan does not go unnoticed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from albot_agents.benchmark.cell import Cell
from albot_agents.evaluation.paired import FIGURES
from albot_agents.evaluation.plan import parse_seeds
from albot_agents.task import own_world, short_name
from albot_core.errors import InputError
from albot_core.files import read_bytes
from albot_core.plain_data import Location, read_config, to_plain
from albot_core.yaml_document import YamlDocument
from albot_maps import load_world
from albot_maps.generators.spec import seeded

LATEST = 1
"""Version of the latest protocol."""
PLANS, SCENE = "plans", "scene"
"""Kinds of worlds: real floor plans, and a probe's own world."""
DIGITS = 16
"""Length of a digest: hexadecimal digits of a SHA-256 hash."""


@dataclass(frozen=True, kw_only=True)
class SeedRanges:
    """Seeds of worlds and episodes, `A..B` with both included. No two ranges overlap."""

    training: str
    """For training; worlds of these seeds may have any parameters."""
    validation: str
    """For choosing among trained agents and for tuning by hand."""
    test: str
    """For the table alone."""

    def __post_init__(self) -> None:
        names = tuple(vars(self))
        ranges = [parse_seeds(getattr(self, name), f"SeedRanges.{name}") for name in names]
        for name, one, other in zip(names[1:], ranges, ranges[1:], strict=False):
            if one[-1] >= other[0]:
                expected = f"seeds above {one[-1]}"
                raise InputError(f"SeedRanges.{name}", expected, getattr(self, name))


@dataclass(frozen=True, kw_only=True)
class WorldKind:
    """A kind of worlds: random ones, files, or (with neither) a probe's own."""

    spec: str = ""
    """Spec of the random worlds, without a seed: each test seed is a world."""
    digest: str = ""
    """`world_digest` of the random world of the first test seed."""
    files: Mapping[str, str] | None = None
    """Names of the files, and the digests of their content. Each is run with the first test seeds,
    as many as make up the episodes of a cell."""


@dataclass(frozen=True, kw_only=True)
class TaskProtocol:
    """What is measured in a task."""

    reference: str
    """Name of the agent from which the others' differences are told."""
    figure: str
    """The figure whose differences are told (see `paired.FIGURES`)."""
    steps: int | None
    """Time limit (steps of 0.1 s); None where each episode has its own."""
    worlds: tuple[str, ...]
    """The kinds of worlds."""

    def __post_init__(self) -> None:
        if self.figure not in FIGURES:
            raise InputError("TaskProtocol.figure", f"one of {', '.join(FIGURES)}", self.figure)


@dataclass(frozen=True, kw_only=True)
class EpisodeKey:
    """An episode of the protocol."""

    world: str
    """The world's spec, or the name of its file."""
    seed: int
    """Seed of environment and agent."""


@dataclass(frozen=True, kw_only=True)
class Protocol:
    """What a table of results is made of. See `docs/benchmark.md`."""

    protocol: int
    """Its version."""
    episodes: int
    """Smallest number of episodes of a cell."""
    seeds: SeedRanges
    """Seeds of worlds and episodes."""
    odometers: tuple[str, ...]
    """Presets of odometer noise; the first is the one of the first table."""
    budgets: tuple[int, ...]
    """Samples of a training, in ascending order. A trained agent is filed under the smallest one
    that its plan does not exceed (`n_timesteps`): a training ends with a whole rollout, a little
    later, and the agent that is kept may be from before its end."""
    worlds: Mapping[str, WorldKind]
    """The kinds of worlds."""
    tasks: Mapping[str, TaskProtocol]
    """The tasks by the ids of their environments."""

    def __post_init__(self) -> None:
        for task in self.tasks.values():
            for kind in task.worlds:
                if kind not in self.worlds:
                    raise InputError("Protocol.tasks", f"one of {', '.join(self.worlds)}", kind)

    def keys(self, task: str, kind: str) -> list[EpisodeKey]:
        """Return the episodes of a cell, in the order in which they are run.

        With fewer episodes than all, the first ones are run. Of files, all come with the first
        seed before any comes with the second.
        """
        worlds, seeds = self.worlds[kind], parse_seeds(self.seeds.test)
        if worlds.files is not None:
            each = -(-self.episodes // len(worlds.files))
            seeds = seeds[:each]
            return [EpisodeKey(world=name, seed=seed) for seed in seeds for name in worlds.files]
        seeds = seeds[: self.episodes]
        if not worlds.spec:
            scene = own_world(task)
            assert scene is not None, f"{task} has no world of its own"
            return [EpisodeKey(world=scene, seed=seed) for seed in seeds]
        return [EpisodeKey(world=seeded(worlds.spec, seed), seed=seed) for seed in seeds]

    def has(self, cell: Cell) -> bool:
        """Return whether a cell is one of its table, whoever the agent is."""
        task = self.tasks.get(cell.task)
        return task is not None and cell.worlds in task.worlds and cell.odometer in self.odometers

    def order(self, cell: Cell) -> tuple[Any, ...]:
        """Return the place of a cell among others: by task, worlds, odometer, agent, mapper."""
        where = [*self.tasks].index(cell.task), [*self.worlds].index(cell.worlds)
        return (*where, self.odometers.index(cell.odometer), cell.agent, cell.mapper)

    @property
    def digest(self) -> str:
        """A digest of all that it says."""
        text = json.dumps(to_plain(self), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]

    def budget(self, samples: int) -> int | None:
        """Return the budget of a plan with so many samples; None if it exceeds all."""
        return next((budget for budget in self.budgets if samples <= budget), None)

    def check_worlds(self, kind: str, plans: Path | None) -> None:
        """Check that worlds are those with which the protocol was frozen.

        Args:
            kind: The kind of worlds.
            plans: The folder of the floor plans, if any.

        Raises:
            InputError: They are others, or a floor plan is missing.
        """
        worlds = self.worlds[kind]
        where = f"protocol {self.protocol}, {kind}"
        if worlds.files is not None:
            if plans is None:
                raise InputError(where, "--plans, the folder of the floor plans", "none")
            for name, digest in worlds.files.items():
                found = hashlib.sha256(read_bytes(plans / name)).hexdigest()[:DIGITS]
                if found != digest:
                    expected = f"the floor plan with the SHA-256 hash {digest}…"
                    raise InputError(plans / name, expected, found)
        elif worlds.spec:
            spec = seeded(worlds.spec, parse_seeds(self.seeds.test)[0])
            found = world_digest(spec)
            if found != worlds.digest:
                raise InputError(where, f"{spec} with the digest {worlds.digest}", found)


def world_digest(spec: str) -> str:
    """Return a digest of a world's walls and starts."""
    world = load_world(spec)
    digest = hashlib.sha256(world.walls.tobytes())
    digest.update(np.ascontiguousarray(world.starts).tobytes())
    return digest.hexdigest()[:DIGITS]


@cache
def find_protocol(version: int = LATEST) -> Protocol:
    """Return a protocol of the package.

    Raises:
        InputError: There is no such version.
    """
    file = resources.files("albot_agents.benchmark") / f"protocol_{version}.yml"
    if not file.is_file():
        known = ", ".join(str(number) for number in range(1, LATEST + 1))
        raise InputError("protocol", f"a known version: {known}", str(version))
    document = YamlDocument(file.read_text(encoding="utf-8"), file.name)
    return read_config(Protocol, document.data, Location(file.name, place=document.place))


def task_folder(task: str) -> str:
    """Return a task's name in files: its short name and its version, `homing-v0`."""
    return f"{short_name(task)}-{task.rpartition('-')[2]}"
