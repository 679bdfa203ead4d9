"""Episode states: all that the future of an episode depends on, to branch or to move it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.plain_data import differences
from albot_env.sim.batch_simulator import SimulatorState
from albot_maps import World, WorldSet


class RobotState(NamedTuple):
    """State of one robot of a task."""

    arrays: Mapping[str, np.ndarray]
    """Its rows of the task's arrays, by table and name: `stats.steps`."""
    simulator: SimulatorState | None = None
    """Its body, its sensors and what moves around it; None in place recognition."""
    mapper: Mapping[str, np.ndarray] | None = None
    """Its mapper's state; None without a mapper, and in place recognition."""
    journey: Any = None
    """Its tour in place recognition, a frozen dataclass; None in other tasks."""


@dataclass(frozen=True, kw_only=True, eq=False)
class EpisodeState:
    """State of an episode, as `get_state` of an environment returns it.

    It is plain data: arrays, numbers and text, in dataclasses and mappings. Nothing in it changes
    when the environment goes on, and it can be pickled for another process. `set_state` of an
    environment with the same settings continues the episode to the bit.
    """

    environment: str
    """Id of the environment."""
    settings: Mapping[str, Any]
    """The settings that decide what comes next, as plain data (`TaskInterface.identity`)."""
    world: World
    """The world of the episode."""
    world_number: int
    """Its number among the environment's worlds."""
    generator: Mapping[str, Any]
    """State of `np_random`, which draws the following episodes."""
    robot: RobotState
    """State of the robot."""

    @property
    def steps(self) -> int:
        """Number of steps since the reset, as a `TimeLimit` counts them."""
        return int(self.robot.arrays["stats.steps"])


def generator_state(rng: np.random.Generator) -> Mapping[str, Any]:
    """Return the state of a generator of any of numpy's kinds."""
    state: Mapping[str, Any] = rng.bit_generator.state
    return state


def generator_of(state: Mapping[str, Any]) -> np.random.Generator:
    """Return a generator in a state that `generator_state` returned."""
    bits = getattr(np.random, state["bit_generator"])()
    bits.state = state
    return np.random.Generator(bits)


def check_state(
    state: Any, environment: str, settings: Mapping[str, Any], worlds: WorldSet, name: str = ""
) -> World:
    """Return an environment's own instance of a state's world.

    Args:
        state: The state.
        environment: Id of the environment that is to continue it.
        settings: The settings of that environment (see `EpisodeState.settings`).
        worlds: Its worlds.
        name: Its name in errors; by default its id.

    Raises:
        InputError: It is no state, or is one of another environment, of other settings or of
            another world.
    """
    if not isinstance(state, EpisodeState):
        expected = "a state that get_state returned"
        raise InputError(name or environment, expected, repr(state), place="state")
    theirs = {"environment": state.environment, **state.settings}
    different = differences(theirs, {"environment": environment, **settings})
    if different:
        expected = "a state of an environment with the same settings"
        found = f"one with {different[0]}"
        raise InputError(name or environment, expected, found, place="state")
    if state.world_number < len(worlds):
        own = worlds[state.world_number]
        if is_same_world(own, state.world):
            return own
    expected = f"a state in world {state.world_number} of the environment's"
    raise InputError(name or environment, expected, f"one in {state.world.name}", place="state")


def is_same_world(one: World, other: World) -> bool:
    """Whether episodes in two worlds are the same."""
    if one is other:
        return True
    arrays = [(one.walls, other.walls), (one.glass, other.glass), (one.starts, other.starts)]
    arrays += zip(
        [room.boundary for room in one.rooms], [room.boundary for room in other.rooms], strict=False
    )
    return (
        one.name == other.name
        and [room.name for room in one.rooms] == [room.name for room in other.rooms]
        and all(np.array_equal(mine, its) for mine, its in arrays)
        and one.movables == other.movables
    )
