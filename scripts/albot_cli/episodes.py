"""The episodes that `albot play` shows: one that runs, and one that was recorded."""

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
    """The number of the moment: that of the steps before it."""
    steps: int
    """How many steps it has, at most."""
    duration: float | None
    """How long it takes in simulated time (s); None where it is not known."""
    contacts: int
    """In how many steps so far the robot touched something."""

    @property
    def over(self) -> bool:
        """Whether this is its last moment."""

    @property
    def time(self) -> float:
        """Simulated time since its beginning (s)."""

    @property
    def frame(self) -> Frame:
        """What is to be drawn of this moment."""

    def advance(self) -> None:
        """Go on to the next moment; at the last one nothing happens."""

    def jump(self, steps: int, seconds: float) -> None:
        """Go so many steps, and so much simulated time (s), on or back, as far as that goes."""


class RunningEpisode:
    """An episode of an environment that an agent acts in.

    Args:
        env: The environment.
        agent: The agent.
        seed: Seed of both.
        steps: After so many steps the environment truncates it.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], agent: Agent, seed: int, *, steps: int
    ) -> None:
        inside = env.unwrapped
        assert isinstance(inside, SingleEnv)
        self._env, self._inside, self._agent = env, inside, agent
        self.step, self.steps, self.over = 0, steps, False
        self.duration: float | None = None
        self.contacts = 0
        self.info: Mapping[str, Any]
        """The last info: the truth."""
        self._observation, self.info = begin_episode(env, agent, seed)

    @property
    def time(self) -> float:
        """Simulated time since its beginning (s)."""
        return float(self.info["time"])

    @property
    def frame(self) -> Frame:
        """What is to be drawn of this moment."""
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
        """Take so many steps: there is no way back, and of seconds nothing is known."""
        for _ in range(steps):
            self.advance()


class RecordedEpisode:
    """An episode in a file.

    Args:
        path: The file.
        seekable: Whether one can go back in it. It then stays in memory as far as it was read.

    Raises:
        InputError: The file is no episode, or holds no step.
    """

    def __init__(self, path: Path, *, seekable: bool) -> None:
        self.reader = EpisodeReader(path)
        """What reads the file."""
        self.duration: float | None
        self.steps, self.duration = self.reader.measure()
        self._rest = self.reader.moments()
        first = next(self._rest, None)
        if first is None:
            raise InputError(path, "an episode with at least one step", "its header alone")
        self._kept, self._seekable = [first], seekable
        self._show(first)

    def _show(self, first: Moment) -> None:
        """Begin at the first moment."""
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
        """What is to be drawn of this moment."""
        return self._trace.frame

    def advance(self) -> None:
        """Go on to the next moment."""
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
        """Go on or back, in memory; back is on from the beginning, so that the map is as it was."""
        step, time = self.step + steps, self.time + seconds
        if seconds < 0:
            stamps = [moment.reading.stamp for moment in self._kept]
            step = bisect_right(stamps, time) - 1
        if step < self.step:
            self._show(self._kept[0])
        while not self.over and (self.step < step or (seconds > 0 and self.time < time)):
            self.advance()
