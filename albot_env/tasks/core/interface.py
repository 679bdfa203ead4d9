"""How a task's robots meet an agent: in which form actions are taken and observations given."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_env.tasks.core.observation import Parts
from albot_env.tasks.core.precompile import precompile
from albot_env.tasks.core.robots import BatchedRobots
from albot_env.tasks.core.settings import equip

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}

CLOSED = "{}: it was closed, and is to be made anew"
"""What is wrong where an environment goes on after its end; with its id."""

Observation = Float32[np.ndarray, "..."] | Parts
Robots = TypeVar("Robots", bound=BatchedRobots)


class TaskInterface(Generic[Robots]):
    """The robots of a task, made by the settings of an environment, with its spaces.

    Args:
        task: The task's class.
        robots: How many robots.
        threads: Threads that share the work; None for as many as there are processors.
        mapper, odometer, laser, sonar, scenes, observation, action, movables: See
            `CommonSettings`.
        of_task: The task's own settings: the keywords of its class.

    Raises:
        InputError: There is no such mapper, sensor or form, or a setting of the task is wrong.
    """

    def __init__(
        self,
        task: type[Robots],
        robots: int,
        *,
        threads: int | None = 1,
        mapper: str = "albot1",
        mapper_config: Any = None,
        odometer: str = "pioneer",
        laser: str = "lms-200",
        sonar: str = "pioneer",
        scenes: str = "none",
        observation: str = "flat",
        action: str = "continuous",
        movables: bool = True,
        **of_task: Any,
    ) -> None:
        if observation not in ("flat", "dict"):
            raise InputError(
                task.environment, "flat or dict", str(observation), place="observation"
            )
        if action not in ("continuous", "discrete"):
            raise InputError(
                task.environment, "continuous or discrete", str(action), place="action"
            )
        equipment = equip(
            mapper=mapper,
            mapper_config=mapper_config,
            odometer=odometer,
            laser=laser,
            sonar=sonar,
            scenes=scenes,
            movables=movables,
            threads=threads,
        )
        precompile(equipment)
        self.mapper, self.odometer = mapper, odometer
        """Names of the mapper and of the odometer's preset."""
        # A task's class takes other keywords than that of any robots.
        self.robots: Robots = task(robots, equipment, **of_task)
        """The robots."""
        self.observing = self.robots.observing
        """How observations are made of readings, with the sensors chosen."""
        self._flat, self._discrete = observation == "flat", action == "discrete"
        actions, observing = self.robots.actions, self.observing
        self.action_space = actions.choice_space if self._discrete else actions.space
        """The space of one robot's actions."""
        self.observation_space = observing.flat_space if self._flat else observing.dict_space
        """The space of one robot's observations."""

    def act_single(self, action: Any) -> None:
        """One control step of a robot that is alone.

        Raises:
            InputError: The action is not in its space.
        """
        actions, environment = self.robots.actions, self.robots.environment
        if self._discrete:
            action = actions.chosen(action, None, environment)
        self.robots.act(actions.single(action, environment))

    def act_batch(self, actions: Any, count: int) -> None:
        """One control step of so many robots.

        Raises:
            InputError: An action is not in its space.
        """
        form, environment = self.robots.actions, self.robots.environment
        if self._discrete:
            actions = form.chosen(actions, count, environment)
        self.robots.act(form.batch(actions, count, environment))

    def shown(self, row: Float32[np.ndarray, "length"]) -> Observation:
        """An observation as it is asked for: in one row, as it is, or by part."""
        return row if self._flat else self.observing.split(row)

    def shown_all(self, rows: Float32[np.ndarray, "robots length"]) -> Observation:
        """Many observations, likewise."""
        return rows if self._flat else self.observing.split_rows(rows)
