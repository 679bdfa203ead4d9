"""The episodes that `albot play` shows: running and recorded ones."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import gymnasium

from albot_agents.agent import Agent, begin_episode, choose_action
from albot_core.errors import InputError
from albot_env.recording.episode import Moment
from albot_env.recording.reader import EpisodeReader
from albot_env.rendering.frame import Frame
from albot_env.rendering.trace import Trace
from albot_env.tasks.core.single import SingleEnv


@runtime_checkable
class PlayedEpisode(Protocol):
    """An episode at one of its moments."""

    step: int
    """Number of the current moment: the number of steps before it."""
    steps: int
    """Largest number of steps of the episode."""
    duration: float | None
    """Duration in simulated time (s); None if unknown."""
    contacts: int
    """Number of steps so far in which the robot touched something."""

    @property
    def over(self) -> bool:
        """Whether this is the last moment."""

    @property
    def time(self) -> float:
        """Simulated time since the beginning (s)."""

    @property
    def frame(self) -> Frame:
        """The frame to draw."""

    def advance(self) -> None:
        """Go to the next moment; do nothing at the last one."""

    def jump(self, steps: int, seconds: float) -> None:
        """Go forward, or back if negative, by steps and simulated seconds, as far as possible."""


class RunningEpisode:
    """An episode in which an agent acts in an environment.

    Args:
        env: The environment.
        agent: The agent.
        seed: Seed of both.
        steps: Number of steps after which the environment truncates the episode.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], agent: Agent, seed: int, *, steps: int
    ) -> None:
        inside = env.unwrapped
        assert isinstance(inside, SingleEnv)
        self._env, self._inside, self._agent = env, inside, agent
        self.step, self.over = 0, False
        self.duration: float | None = None
        self.contacts = 0
        self.info: Mapping[str, Any]
        """The last info, with the ground truth."""
        self._observation, self.info = begin_episode(env, agent, seed)
        self.steps = min(steps, inside.most_steps or steps)

    @property
    def time(self) -> float:
        """Simulated time since its beginning (s)."""
        return float(self.info["time"])

    @property
    def frame(self) -> Frame:
        """The frame to draw."""
        return self._inside.frame

    def advance(self) -> None:
        """Take a step."""
        if self.over:
            return
        action = choose_action(self._agent, self._observation, self.info)
        self._observation, _, terminated, truncated, self.info = self._env.step(action)
        self.step += 1
        self.contacts += self.info["collided"]
        self.over = terminated or truncated

    def jump(self, steps: int, seconds: float) -> None:
        """Take `steps` steps; going back and jumping by seconds are not possible."""
        for _ in range(steps):
            self.advance()


class RecordedEpisode:
    """An episode in a file.

    Args:
        path: The file.
        seekable: Whether `jump` can go back; then all moments read so far stay in memory.

    Raises:
        InputError: The file is not an episode, or holds no step.
    """

    def __init__(self, path: Path, *, seekable: bool) -> None:
        self.reader = EpisodeReader(path)
        """The reader of the file."""
        self.duration: float | None
        self.steps, self.duration = self.reader.measure()
        self._rest = self.reader.moments()
        first = next(self._rest, None)
        if first is None:
            raise InputError(path, "an episode with at least one step", "its header alone")
        self._kept, self._seekable = [first], seekable
        self._show(first)

    def _show(self, first: Moment) -> None:
        """Restart at the first moment."""
        self._trace, self._moment, self.step = Trace(self.reader.header, first), first, 0
        self.contacts = 0
        self.rooms = {first.room} - {""}

    @property
    def over(self) -> bool:
        """Whether this is its last moment."""
        return self.step >= self.steps

    @property
    def time(self) -> float:
        """Simulated time since its beginning (s)."""
        return self._moment.reading.stamp

    @property
    def frame(self) -> Frame:
        """The frame to draw."""
        return self._trace.frame

    def advance(self) -> None:
        """Go to the next moment."""
        if self.over:
            return
        if self.step + 1 < len(self._kept):
            moment = self._kept[self.step + 1]
        else:
            moment = next(self._rest)
            if self._seekable:
                self._kept.append(moment)
        self._trace.add(moment)
        self._moment = moment
        self.step += 1
        self.contacts += moment.collided
        self.rooms |= {moment.room} - {""}

    def jump(self, steps: int, seconds: float) -> None:
        """Go forward or back; going back replays from the beginning, which restores the map."""
        step, time = self.step + steps, self.time + seconds
        if seconds < 0:
            stamps = [moment.reading.stamp for moment in self._kept]
            step = bisect_right(stamps, time) - 1
        if step < self.step:
            self._show(self._kept[0])
        while not self.over and (self.step < step or (seconds > 0 and self.time < time)):
            self.advance()
