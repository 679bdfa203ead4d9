"""The followers of a batch: take down the episodes of those robots that are drawn or recorded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from jaxtyping import Int64, UInt8

from albot_core.errors import InputError
from albot_core.ranges import COUNT
from albot_env.rendering.frame import Frame
from albot_env.tasks.core.follower import EpisodeFollower, painted
from albot_env.tasks.core.interface import TaskInterface


class BatchFollowers:
    """Follows the robots of a batch; those that nobody draws or records cost nothing.

    Args:
        interface: The robots and their settings.
        drawn: The robots that are drawn.
    """

    def __init__(self, interface: TaskInterface[Any], drawn: Sequence[int]) -> None:
        self._interface = interface
        self._drawn = frozenset(drawn)
        self._followers = {row: EpisodeFollower(interface, row) for row in sorted(self._drawn)}
        self._blank: UInt8[np.ndarray, "h w 3"] | None = None

    def of(self, row: int) -> EpisodeFollower:
        """Return the follower of a robot, which follows once it has a recorder."""
        return self._followers.setdefault(row, EpisodeFollower(self._interface, row))

    @property
    def frames(self) -> dict[int, Frame]:
        """The present moments of the robots that are followed, by number."""
        frames = {row: follower.frame for row, follower in sorted(self._followers.items())}
        return {row: frame for row, frame in frames.items() if frame is not None}

    def picture(self, row: int) -> UInt8[np.ndarray, "h w 3"] | None:
        """Return the present moment of a robot; black if it is not drawn, None before a reset."""
        followed = next(iter(self._drawn)) if row not in self._drawn else row
        frame = self._followers[followed].frame
        if frame is None or followed == row:
            return None if frame is None else painted(frame)
        if self._blank is None:
            self._blank = np.zeros_like(painted(frame))
        return self._blank

    def begin(
        self, rows: Int64[np.ndarray, "some"], seeds: Mapping[int, int | None], spec: EnvSpec | None
    ) -> None:
        """Begin to follow episodes from their present state.

        Args:
            rows: The robots whose episodes begin.
            seeds: Seeds of the reset, by robot.
            spec: The spec of the batch.
        """
        for row in rows.tolist() if self._followers else ():
            follower = self._followers.get(row)
            if follower is None:
                continue
            if row in self._drawn or follower.records:
                follower.begin(seeds.get(row), spec)
            else:
                follower.forget()

    def add(self, actions: Any, begun: Int64[np.ndarray, "some"]) -> None:
        """Take down a step of all robots but those whose episodes begin with it."""
        for row in sorted(self._followers.keys() - set(begun.tolist())):
            self._followers[row].add(np.asarray(actions)[row])

    def close(self) -> None:
        """End the recordings."""
        for follower in self._followers.values():
            follower.recorder.close()


def choose_drawn(drawn: Any, num_envs: int, render_mode: str | None, source: str) -> Sequence[int]:
    """Return the numbers of the environments that are drawn.

    Args:
        drawn: The numbers asked for; None for all.
        num_envs: Number of environments.
        render_mode: The render mode of the batch.
        source: What is named in errors.

    Raises:
        InputError: `drawn` is no sequence of different environments' numbers, or there is no
            render mode.
    """
    if drawn is None:
        return range(num_envs if render_mode else 0)
    if render_mode is None:
        raise InputError(source, "a render_mode, or no choice", repr(drawn), place="drawn")
    found = list(drawn) if isinstance(drawn, Sequence | np.ndarray) and len(drawn) else []
    valid = all(row in COUNT and row < num_envs for row in found)
    if not found or not valid or len(set(found)) < len(found):
        expected = f"different numbers of environments below {num_envs}"
        raise InputError(source, expected, repr(drawn), place="drawn")
    return [int(row) for row in found]
