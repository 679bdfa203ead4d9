"""The recorded episodes of an evaluation: a file and a page for each."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from albot_agents.evaluation.plan import Trial
from albot_core.files import is_left_over
from albot_env.recording.command import play_command
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace

EPISODE, PAGE, UNFINISHED = ".mcap", ".html", ".part"
"""Endings of the names of episodes, of their pages, and of episodes that still run."""
ONLY = {"failures": False, "successes": True}
"""Which episodes can be kept, by the success that they end with."""
_LONGEST = 80
"""Largest number of characters that a file's name takes from the world's."""
_THUMBNAIL = 400, 240
"""Width and height of the small pictures (pixels)."""
_LEGEND = "truth and belief"
"""What the small pictures show, from left to right."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """An episode that was kept."""

    episode: Path
    """Its file."""
    page: Path
    """The page that plays it."""
    thumbnail: bytes
    """A small picture of its last moment, a PNG."""
    command: str
    """Lines for a shell that make it again; empty if none can."""
    steps: int
    """Number of its steps."""
    seconds: float
    """Its simulated time (s)."""


@dataclass(frozen=True, kw_only=True)
class Recordings:
    """Where the episodes of an evaluation are recorded, and which of them are kept."""

    folder: Path
    """The folder."""
    names: Mapping[tuple[str, str, int], str]
    """Name of each file without its ending, by agent, world and seed."""
    only: str | None = None
    """A key of `ONLY`; None for all."""

    @classmethod
    def plan(cls, folder: Path, trials: Sequence[Trial], only: str | None = None) -> Recordings:
        """Name the files of episodes: by world and seed, and by the agent if there are several."""
        several = len({trial.agent for trial in trials}) > 1
        names: dict[tuple[str, str, int], str] = {}
        taken: set[str] = set()
        for trial in trials:
            wanted = _safe(trial.world)
            if not trial.world.endswith(f":{trial.seed}"):
                wanted += f"-seed-{trial.seed}"
            wanted = f"{_safe(trial.agent)}-{wanted}" if several else wanted
            name, number = wanted, 1
            while name.lower() in taken:  # Some systems take capital letters for small ones.
                number += 1
                name = f"{wanted}-{number}"
            taken.add(name.lower())
            names[trial.agent, trial.world, trial.seed] = name
        return cls(folder=folder, names=names, only=only)

    def path(self, trial: Trial, suffix: str) -> Path:
        """Return a file of an episode."""
        return self.folder / f"{self.names[trial.agent, trial.world, trial.seed]}{suffix}"

    def recorder(self, trial: Trial) -> EpisodeWriter:
        """Return the recorder of an episode, whose file gets its name when the episode is kept."""
        return EpisodeWriter(self.path(trial, UNFINISHED))

    def keep(self, trial: Trial, info: Mapping[str, Any]) -> Recording | None:
        """Write the page of an episode that is over, and name its file; None if it is not kept.

        Args:
            trial: The episode, which was recorded.
            info: Its last info.

        Raises:
            InputError: The page cannot be written.
        """
        from albot_env.rendering.canvas import png_bytes  # slow to load, as all that draws
        from albot_env.rendering.mosaic import Tile, paint_mosaic
        from albot_env.rendering.page import write_page

        if self.only is not None and bool(info["is_success"]) is not ONLY[self.only]:
            self.remove([trial])
            return None
        episode, page = self.path(trial, EPISODE), self.path(trial, PAGE)
        unfinished = self.path(trial, UNFINISHED)
        header, frame = EpisodeReader(unfinished).header, last_frame(unfinished)
        write_page(unfinished, page)
        unfinished.replace(episode)
        return Recording(
            episode=episode,
            page=page,
            thumbnail=png_bytes(paint_mosaic([Tile(frame=frame, label=_LEGEND)], 1, _THUMBNAIL)),
            command=play_command(header, frame.steps),
            steps=frame.steps,
            seconds=frame.time,
        )

    def remove(self, trials: Sequence[Trial]) -> None:
        """Remove all files of episodes, those of an earlier run and of a stopped one too."""
        for trial in trials:
            for suffix in (EPISODE, PAGE, UNFINISHED):
                self.path(trial, suffix).unlink(missing_ok=True)

    def remove_left_overs(self) -> None:
        """Remove the temporary files of processes that were ended while they wrote a page."""
        for path in self.folder.iterdir():
            if is_left_over(path, (PAGE,)):
                path.unlink(missing_ok=True)


def last_frame(episode: Path) -> Frame:
    """Return the last moment of a recorded episode.

    Raises:
        InputError: The episode cannot be read.
    """
    reader = EpisodeReader(episode)
    first, *others = reader.moments()
    trace = Trace(reader.header, first)
    for moment in others:
        trace.add(moment)
    return trace.frame


def _safe(name: str) -> str:
    """Return a name that every file system takes."""
    safe = re.sub(r"[^A-Za-z0-9._-]+", "-", name)[-_LONGEST:].strip(".-")
    return safe or "world"
