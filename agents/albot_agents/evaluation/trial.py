"""One episode of an evaluation: what became of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_agents.agent import choose
from albot_agents.episode import begin_episode
from albot_agents.evaluation.exploring import sample_curve
from albot_agents.evaluation.plan import Trial
from albot_agents.registry import make_agent
from albot_agents.workers import Trade
from albot_core.errors import InputError
from albot_core.geometry.types import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Outcome:
    """What became of an episode."""

    trial: Trial
    """The episode."""
    info: Mapping[str, Any]
    """The last info: the truth at the end."""
    start: Pose
    """Where home is (world frame)."""
    path: Float64[np.ndarray, "steps 2"]
    """The way that the agent drove (m, world frame)."""
    collisions: int
    """How often the robot came into contact with something."""
    rooms: int = 0
    """How many rooms of its world the robot could enter."""
    coverage_curve: Float64[np.ndarray, "samples"] = field(default_factory=lambda: np.empty(0))
    """The share of the ground covered after each metre of the path (`sample_curve`)."""

    @property
    def driven(self) -> float:
        """How far the agent drove (m)."""
        return float(np.hypot(*np.diff(self.path, axis=0).T).sum())


def run_trial(trial: Trial, tell: Callable[[int], None] = lambda _: None) -> Outcome:
    """Run an episode to its end.

    Args:
        trial: The episode.
        tell: Is called with the number of each step before it is taken.

    Raises:
        InputError: There is no such world, mapper or sensor.
    """
    env = trial.make()
    try:
        agent = make_agent(trial.agent, env.get_wrapper_attr("observing"))
        tell(0)
        observation, info = begin_episode(env, agent, trial.seed)
        path, coverages = [info["pose"][:2]], [info.get("coverage")]
        explores = info["path_length"] == 0.0  # No outward journey has covered ground before.
        collisions, touched, over = 0, False, False
        while not over:
            tell(len(path))
            action = choose(agent, observation, info)
            observation, _, terminated, truncated, info = env.step(action)
            path.append(info["pose"][:2])
            coverages.append(info.get("coverage"))
            collisions += info["collided"] and not touched
            touched, over = info["collided"], terminated or truncated
    finally:
        env.close()
    return Outcome(
        trial=trial,
        info=info,
        start=info["start"],
        path=np.array(path),
        collisions=collisions,
        **(_explored(trial, np.array(path), coverages) if explores else {}),
    )


def _explored(
    trial: Trial, path: Float64[np.ndarray, "steps 2"], coverages: Sequence[float | None]
) -> dict[str, Any]:
    """What a trial that set out from the start says of exploring, where its task covers ground."""
    known = [share for share in coverages if share is not None]
    if not known:
        return {}
    rooms = len(trial.place.reachable_rooms)
    return {"rooms": rooms, "coverage_curve": sample_curve(path, known)}


class Evaluation(Trade[Trial, "Outcome | InputError"]):
    """Runs trials; what is wrong with one comes back as the error that it is."""

    def work(self, task: Trial, tell: Callable[[int], None]) -> Outcome | InputError:
        """Run a trial."""
        try:
            return run_trial(task, tell)
        except InputError as error:
            return error

    def died(self, task: Trial, step: int, cause: str) -> Outcome | InputError:
        """A trial that was not survived: our fault.

        Raises:
            RuntimeError: Always.
        """
        raise RuntimeError(f"{task.task} in {task.world}, seed {task.seed}, step {step}: {cause}")
