"""Minari data sets of episodes, for offline reinforcement learning.

https://minari.farama.org/content/dataset_standards/

A data set holds observations, actions, rewards, terminations and truncations to the last bit, each
episode's seed, and the spec of the environment: `dataset.recover_environment()` makes it again. If
the episodes are in several worlds, the environment has all of them, and the episode's option
`world` says which: `env.reset(seed=metadata["seed"], options=metadata["options"])` begins it.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import albot_env
from albot_core.errors import InputError
from albot_core.files import exists, new_folder, scratch_folder
from albot_core.interrupts import interrupts_deferred
from albot_env.export.transitions import Transitions, spec_from_plain
from albot_maps.load import is_range

MINARI_EXTRA = "pip install 'albot-env[minari]'"
"""The command that installs Minari."""
_ID = re.compile(r"(?:[-\w]+/)*[-\w]+-v\d+", re.ASCII)
"""An id in Minari's form, `namespace/name-v0`."""
_ROOT = "MINARI_DATASETS_PATH"
"""The variable with the folder of Minari's data sets."""
_DATA = "data"
"""The folder in a data set's folder that holds all."""
_VARYING = ("world",)
"""Settings that may differ between the episodes of a data set."""


def check_minari(source: object) -> None:
    """Check that Minari is installed, with what its HDF5 files need.

    Args:
        source: The data set, for the error.

    Raises:
        InputError: A library is missing; the message says how to install it.
    """
    missing = [name for name in ("minari", "h5py") if find_spec(name) is None]
    if missing:
        expected = f"what the extra `minari` brings ({MINARI_EXTRA})"
        found = f"the package {' and the package '.join(missing)} missing"
        raise InputError(source, expected, found)


@dataclass(frozen=True, kw_only=True)
class DatasetPlace:
    """Where a data set is, and what it is called."""

    id: str
    """Its id."""
    folder: Path
    """Its folder."""
    load: str
    """What `minari.load_dataset` takes to load it."""

    @classmethod
    def of(cls, text: str) -> DatasetPlace:
        """Return the place of an id among Minari's data sets, or else of a folder.

        An id is `name-v0` or `namespace/name-v0`. A folder that would read as one is told apart by
        a beginning: `./name-v0`.
        """
        if _ID.fullmatch(text):
            root = os.environ.get(_ROOT) or Path.home() / ".minari" / "datasets"
            return cls(id=text, folder=Path(root, text), load=text)
        folder = Path(text).resolve()
        name = re.sub(r"[^-\w]+", "-", folder.name, flags=re.ASCII).strip("-") or "episodes"
        name = name if _ID.fullmatch(name) else f"{name}-v0"
        return cls(id=name, folder=folder, load=str(folder))

    @property
    def facts(self) -> dict[str, str]:
        """Its fields as plain data."""
        return {"id": self.id, "folder": str(self.folder), "load": self.load}


def check_place(place: DatasetPlace, *, force: bool = False) -> None:
    """Check that a data set can be written.

    Args:
        place: Its place.
        force: Whether a data set that is there may be replaced.

    Raises:
        InputError: Minari is not installed, or something is there that must not be replaced.
    """
    check_minari(place.folder)
    if not exists(place.folder):
        return
    if not place.folder.is_dir():
        raise InputError(place.folder, "a folder for a data set", "a file")
    others = sorted(path.name for path in place.folder.iterdir() if path.name != _DATA)
    if others:
        raise InputError(place.folder, "an empty folder or a Minari data set", others[0])
    if (place.folder / _DATA).exists() and not force:
        raise InputError(place.folder, "no existing data set, or --force to replace it", "one")


class MinariWriter:
    """Writes the episodes of one data set, one after another.

    Args:
        folder: An empty folder.
        name: The data set's id.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self._folder, self._name = folder, name
        self._first: Transitions | None = None
        self._worlds: list[Any] = []
        self._agents: list[str] = []
        self._limits: list[int | None] = []
        self.episodes = self.steps = 0
        """Numbers of episodes and of steps so far."""

    def add(self, episode: Transitions, source: object) -> None:
        """Write the next episode.

        Args:
            episode: The episode.
            source: Where it is from, for errors.

        Raises:
            InputError: It is from another environment than the first one, not only in another
                world.
        """
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_storage import MinariStorage

        if self._first is None:
            self._storage: Any = MinariStorage.new(
                self._folder,
                observation_space=episode.observation_space,
                action_space=episode.action_space,
                data_format="hdf5",
                jpeg_encoding=False,
            )
        else:
            _check_same_environment(self._first, episode, source)
        self._first = self._first or episode
        options = self._world_option(episode, source)
        buffer = EpisodeBuffer(
            id=self.episodes,
            seed=_storable(episode.seed),
            options=options,
            observations=episode.observations,
            actions=episode.actions,
            rewards=episode.rewards,
            terminations=episode.terminations,
            truncations=episode.truncations,
        )
        self._storage.update_episodes([buffer])
        about = {"agent": episode.agent, "world": str(episode.spec["kwargs"]["world"])}
        self._storage.update_episode_metadata([about], [self.episodes])
        self._agents.append(episode.agent)
        self._limits.append(episode.spec["max_episode_steps"])
        self.episodes += 1
        self.steps += len(episode.rewards)

    def finish(self) -> None:
        """Write what is known of the whole data set; there must be an episode."""
        from minari import __version__ as minari_version

        assert self._first is not None
        spec = dict(self._first.spec)
        spec["kwargs"] = spec["kwargs"] | {"world": self._worlds[0]}
        if len(self._worlds) > 1:
            spec["kwargs"] |= {"world": self._worlds}
        limits = [limit for limit in self._limits if limit is not None]
        spec["max_episode_steps"] = max(limits) if len(limits) == len(self._limits) else None
        agents = ", ".join(dict.fromkeys(agent for agent in self._agents if agent))
        self._storage.update_metadata(
            {
                "dataset_id": self._name,
                "env_spec": spec_from_plain(spec).to_json(),
                "algorithm_name": agents or "unknown",
                "description": f"{self.episodes} episodes of {spec['id']}, of albot-env.",
                "minari_version": minari_version,
                "requirements": [f"albot-env=={albot_env.__version__}"],
            }
        )

    def _world_option(self, episode: Transitions, source: object) -> dict[str, int] | None:
        """Return the reset's option for an episode's world; None if its seed draws the world."""
        world = episode.spec["kwargs"]["world"]
        if world not in self._worlds:
            self._worlds.append(world)
        is_set = [isinstance(each, list) or is_range(each) for each in self._worlds]
        if any(is_set) and len(self._worlds) > 1:
            expected = f"the worlds of the first episode, {self._worlds[0]}"
            raise InputError(source, expected, str(world), place="spec.kwargs.world")
        return None if is_set[0] else {"world": self._worlds.index(world)}


@contextmanager
def new_minari_dataset(place: DatasetPlace, *, force: bool = False) -> Iterator[MinariWriter]:
    """Yield the writer of a new data set, which appears at its place when the block ends.

    If the block raises, or adds no episode, nothing is left.

    Args:
        place: Where to write it.
        force: Whether a data set that is there is replaced.

    Raises:
        InputError: As `check_place`; or the folder cannot be made.
    """
    check_place(place, force=force)
    with scratch_folder() as scratch:
        made = scratch / _DATA
        writer = MinariWriter(made, place.id)
        yield writer
        if not writer.episodes:
            return
        writer.finish()
        with new_folder(place.folder), interrupts_deferred():
            beside = place.folder / f".{_DATA}"
            try:
                shutil.move(made, beside)  # It may be another disk, which may be full.
            except BaseException:
                shutil.rmtree(beside, ignore_errors=True)
                raise
            shutil.rmtree(place.folder / _DATA, ignore_errors=True)
            beside.rename(place.folder / _DATA)


def _check_same_environment(first: Transitions, other: Transitions, source: object) -> None:
    """Raise InputError if two episodes are from environments that differ in more than the world."""
    if first.spec["id"] != other.spec["id"]:
        expected = f"an episode of {first.spec['id']}, as the first one"
        raise InputError(source, expected, other.spec["id"])
    ours, theirs = (_fixed(each.spec["kwargs"]) for each in (first, other))
    for name in {**ours, **theirs}:
        if ours.get(name) != theirs.get(name):
            expected = f"{ours.get(name, 'the default')!r}, as in the first episode"
            found = f"{theirs.get(name, 'the default')!r}"
            raise InputError(source, expected, found, place=name)
    spaces = ("observation_space", "action_space")
    for name in spaces:
        if getattr(first, name) != getattr(other, name):
            expected = f"{getattr(first, name)}, as in the first episode"
            raise InputError(source, expected, str(getattr(other, name)), place=name)


def _fixed(kwargs: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in kwargs.items() if name not in _VARYING}


def _storable(seed: int) -> int | str:
    """Return a seed, as text if HDF5 has no number so large; Minari reads both as a number."""
    return seed if seed <= np.iinfo(np.int64).max else str(seed)
