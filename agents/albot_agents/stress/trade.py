"""Stress episodes as work for parallel processes."""

from __future__ import annotations

from collections.abc import Callable

from albot_agents.stress.plan import Episode, Violation
from albot_agents.stress.run import Outcome, run_episode
from albot_agents.workers import Trade
from albot_env.stress.checks import Limits


class Stress(Trade[Episode, Outcome]):
    """Runs episodes and watches every step; that the process dies is a violation too."""

    def work(self, task: Episode, tell: Callable[[int], None]) -> Outcome:
        """Run an episode."""
        return run_episode(task, tell, Limits())

    def died(self, task: Episode, step: int, cause: str) -> Outcome:
        """An episode that was not survived."""
        violation = Violation(episode=task, step=step, what=cause)
        return Outcome(episode=task, steps=step, violations=(violation,))
