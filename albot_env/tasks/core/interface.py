"""The interface between a task's robots and an agent: forms of actions and observations."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import numpy as np
from jaxtyping import Float32

from albot_core.errors import InputError
from albot_core.plain_data import to_plain
from albot_core.robot import DEFAULT_ROBOT
from albot_core.sensing.faults.registry import spec_of
from albot_env.tasks.core.observation import Parts
from albot_env.tasks.core.precompile import precompile
from albot_env.tasks.core.settings import chosen_config, config_class, equip
from albot_env.tasks.core.task import Task

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}

CLOSED = "{}: the environment is closed; make a new one"
"""Error text for the use of a closed environment; `{}` is its id."""
Observation = Float32[np.ndarray, "..."] | Parts
Robots = TypeVar("Robots", bound=Task)


class TaskInterface(Generic[Robots]):
    """A task's robots, made from an environment's settings, with their spaces.

    Args:
        task: The task's class.
        robots: Number of robots.
        threads: Threads that share the work; None for one per processor.
        mapper, odometer, laser, sonar, scenes, compass, observation, action, movables, reveal,
            faults, saved_map, extend_map, robot: See `CommonSettings`.
        of_task: The task's own settings, which are the keywords of its class.

    Raises:
        InputError: A mapper, sensor or form is unknown, or a setting of the task is invalid.
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
        compass: str = "none",
        observation: str = "flat",
        action: str = "continuous",
        movables: bool = True,
        reveal: bool = False,
        faults: Any = None,
        saved_map: Any = None,
        extend_map: bool = False,
        robot: Any = DEFAULT_ROBOT,
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
            compass=compass,
            movables=movables,
            reveal=reveal,
            faults=faults,
            saved_map=saved_map,
            extend_map=extend_map,
            robot=robot,
            threads=threads,
            environment=task.environment,
        )
        precompile(equipment)
        twin = task.environment.replace("-v", "Revealed-v")
        self.environment = twin if equipment.reveal else task.environment
        """Id of the environment."""
        kind = config_class(task)
        of_task["config"] = chosen_config(of_task.get("config"), kind, self.environment)
        self.mapper, self.odometer = mapper, odometer
        """Names of the mapper and of the odometer's preset."""
        self.mapper_config = equipment.mapper_config
        """All parameters of the mapper; None without one."""
        self.robot_config = equipment.robot
        """Body and drive of the robots."""
        names = {"odometer": odometer, "laser": laser, "sonar": sonar, "scenes": scenes}
        names["compass"] = compass
        self._identity = {"mapper": mapper, "mapper_config": equipment.mapper_config, **names}
        own = {"movables": movables, "reveal": reveal, "robot": equipment.robot, "journeys": 0}
        self._identity |= own | of_task
        if equipment.faults:  # States of old episodes, without any, stay valid.
            self._identity["faults"] = spec_of(equipment.faults)
        if equipment.saved_map is not None:
            self._identity |= {"saved_map": equipment.map_digest, "extend_map": extend_map}
        make: Any = task  # A task is made of robots, equipment and its own settings.
        self.robots: Robots = make(robots, equipment, **of_task)
        """The robots."""
        self.observation_config = self.robots.observation_config
        """The observation config, fitted to the robots' sensors."""
        self._flat, self._discrete = observation == "flat", action == "discrete"
        actions, observation_config = self.robots.actions, self.observation_config
        self.action_space = actions.choice_space if self._discrete else actions.space
        """The space of one robot's actions."""
        self.observation_space = (
            observation_config.flat_space if self._flat else observation_config.dict_space
        )
        """The space of one robot's observations."""

    @property
    def identity(self) -> dict[str, Any]:
        """The settings that decide how episodes go on, as plain data.

        The settings `observation` and `action` are no part of it; the whole configuration is.
        """
        plain: dict[str, Any] = to_plain(self._identity)
        return plain

    def act_single(self, action: Any) -> None:
        """Run one control step of a single robot.

        Raises:
            InputError: The action is not in its space.
        """
        actions, environment = self.robots.actions, self.environment
        if self._discrete:
            action = actions.chosen(action, None, environment)
        self.robots.act(actions.single(action, environment))

    def act_batch(self, actions: Any, count: int) -> None:
        """Run one control step of `count` robots.

        Raises:
            InputError: An action is not in its space.
        """
        form, environment = self.robots.actions, self.environment
        if self._discrete:
            actions = form.chosen(actions, count, environment)
        self.robots.act(form.batch(actions, count, environment))

    def shown(self, row: Float32[np.ndarray, "length"]) -> Observation:
        """Return an observation in the requested form: flat as it is, or split into parts."""
        return row if self._flat else self.observation_config.split(row)

    def shown_all(self, rows: Float32[np.ndarray, "robots length"]) -> Observation:
        """Return many observations in the requested form."""
        return rows if self._flat else self.observation_config.split_rows(rows)
