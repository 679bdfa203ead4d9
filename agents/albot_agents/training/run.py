"""A training run: environments and learner in turn, and everything that is written on the way."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Any

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from torch.utils.tensorboard import SummaryWriter

from albot_agents.plain import Where, read_fields
from albot_agents.trained.agent_file import AgentFile, TrainingFacts
from albot_agents.training.checkpoint import (
    Checkpoint,
    checkpoints,
    read_checkpoint,
    restore,
    take_checkpoint,
)
from albot_agents.training.course import Course
from albot_agents.training.evaluations import Evaluations
from albot_agents.training.export import Exporter
from albot_agents.training.folder import RunFolder, facts
from albot_agents.training.learner import make_learner
from albot_agents.training.monitor import MonitorFile
from albot_agents.training.plan import TrainingPlan
from albot_core.errors import InputError

_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_RUN = {"stage": int, "stage_began": int, "monitor": int, "seconds": float, "episodes": int}
"""What a checkpoint tells of a run: the stage and the samples when it began, bytes of the
monitor file, seconds and episodes so far."""


Tell = Callable[[int, str], None]
"""Is told how many samples there were, and how it goes."""


class TrainingRun:
    """A training, from its beginning or from where it was left.

    Args:
        folder: Where it writes; `RunFolder.begin` or `RunFolder.resume` came before.
        plan: The plan.
        warn: Is told, in a sentence, what was wrong and is not in the way.

    Raises:
        InputError: An environment cannot be made, or a file of the run is not as it was left.
    """

    def __init__(
        self,
        folder: RunFolder,
        plan: TrainingPlan,
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:
        self._folder, self._plan = folder, plan
        self._tell: Tell = lambda done, note: None
        found = _newest(folder, warn)
        self._left = dict.fromkeys(_RUN, 0) | ({} if found is None else _read_run(*found))
        self._exporter = Exporter(plan)
        self._course = Course(plan, int(self._left["stage"]), float(self._left["seconds"]))
        self.learner: OnPolicyAlgorithm = make_learner(plan, self._course)
        """What learns."""
        if found is not None:
            path, checkpoint = found
            restore(self.learner, checkpoint, path)
            self._course.seed(self._chance())
        self._stage_began = int(self._left["stage_began"])
        self._began_at = self._saved_at = self.learner.num_timesteps
        self._evaluations = self._open_evaluations()
        # From here on there is a run in the folder.
        self._monitor = MonitorFile(folder.monitor, plan.task, int(self._left["monitor"]))
        self._snapshot = self._take()

    def run(self, tell: Tell | None = None) -> dict[str, Any]:
        """Train to the end, or until Ctrl-C; what came of it, as `albot train --json` tells.

        Args:
            tell: Is told how far it has come.

        Raises:
            InputError: There is no room to write; the last good checkpoint is whole.
        """
        stopped, self._tell = False, tell or self._tell
        log = _Log(str(self._folder.tensorboard), self.learner.num_timesteps)
        self.learner.set_logger(Logger(str(self._folder.tensorboard), [log]))
        try:
            remaining = self._plan.n_timesteps - self.learner.num_timesteps
            if remaining > 0:
                self._lay_in()
                steward = _Steward(self._between)
                self.learner.learn(remaining, callback=steward, reset_num_timesteps=False)
            self._between(last=True)
        except KeyboardInterrupt:
            stopped = True
            self._save()
        except OSError as error:
            if error.errno not in _NO_ROOM:
                raise
            found = f"{error.strerror}; {self._good()}"
            raise InputError(self._folder.path, "room to write", found) from None
        finally:
            log.close()
            self.close()
        return self._result(stopped)

    def close(self) -> None:
        """Let the environments go; called by `run`."""
        self._course.close()
        if self._evaluations is not None:
            self._evaluations.close()

    def _lay_in(self) -> None:
        """Make the journeys that the environments will draw."""
        samples = self.learner.num_timesteps
        for each in (self._course, self._evaluations):
            if each is not None:
                each.lay_in(lambda note: self._tell(samples, note))

    def _between(self, last: bool = False) -> None:
        """Between two rollouts, and at the end: move on, measure, write."""
        samples = self.learner.num_timesteps
        self._monitor.add(self._course.take_rows())
        if self._course.is_over(samples - self._stage_began) and not last:
            self._next_stage()
        self._follow_schedules(samples)
        self._snapshot = self._take()
        self._measure(last)
        if last or samples - self._saved_at >= self._plan.checkpoint_every:
            self._save()
        self._tell(samples, self._note())

    def _next_stage(self) -> None:
        """Let the learner go on in the next stage's environments."""
        learner, samples = self.learner, self.learner.num_timesteps
        begun = self._course.next_stage(self._chance(), lambda note: self._tell(samples, note))
        learner._last_obs = begun  # type: ignore[assignment]
        learner._last_episode_starts = np.ones(self._plan.n_envs, np.bool_)
        self._stage_began = samples

    def _follow_schedules(self, samples: int) -> None:
        """The entropy's worth; stable-baselines3 sees to the other schedules."""
        remaining = 1 - samples / self._plan.n_timesteps
        self.learner.ent_coef = self._plan.schedule("ent_coef")(max(0.0, remaining))

    def _measure(self, last: bool) -> None:
        """Evaluate the policy where it is time to, and keep it where it is the best so far."""
        evaluation, evaluations = self._plan.evaluation, self._evaluations
        samples = self.learner.num_timesteps
        if evaluation is None or evaluations is None:
            return
        if samples - evaluations.samples < (1 if last else evaluation.every):
            return
        best = evaluations.measure(self.learner)
        for name, value in evaluations.last.items():
            if value is not None:
                self.learner.logger.record(f"eval/{name}", value)
        if best:
            self._export().save(self._folder.best)

    def _take(self) -> Checkpoint:
        run = {
            "stage": self._course.stage,
            "stage_began": self._stage_began,
            "monitor": self._monitor.size,
            "seconds": self._course.elapsed,
            "episodes": self._episodes,
        }
        return take_checkpoint(self.learner, run)

    def _save(self) -> None:
        """Write the last snapshot, and its policy."""
        self._snapshot.save(self._folder.checkpoints)
        self._saved_at = self._snapshot.samples
        self._export().save(self._folder.last)

    def _export(self) -> AgentFile:
        """The agent of the last snapshot."""
        snapshot = self._snapshot
        told = TrainingFacts(
            plan=self._plan,
            command=self._folder.command,
            samples=snapshot.samples,
            episodes=snapshot.run["episodes"],
            seconds=round(snapshot.run["seconds"], 1),
            curve=(self._evaluations or self._monitor).curve,
            **facts(),
        )
        return self._exporter.agent(snapshot.weights, told)

    @property
    def _episodes(self) -> int:
        """Episodes since the training began."""
        return int(self._left["episodes"]) + self._course.episodes

    def _result(self, stopped: bool) -> dict[str, Any]:
        """What came of it."""
        samples, course = self.learner.num_timesteps, self._course
        seconds = course.elapsed - float(self._left["seconds"])
        left = checkpoints(self._folder.checkpoints)
        files = {"best": self._folder.best, "last": self._folder.last}
        return {
            "task": self._plan.task,
            "algorithm": self._plan.algorithm,
            "seed": self._plan.seed,
            "folder": str(self._folder.path),
            "samples": self._snapshot.samples,
            "episodes": self._snapshot.run["episodes"],
            "stage": course.stage,
            "seconds": seconds,
            "samples_per_second": (samples - self._began_at) / seconds,
            "environment_share": course.stepping / seconds,
            "device": str(self.learner.device),
            "success_rate": course.success_rate,
            "evaluation": self._evaluations.last if self._evaluations else {},
            "stopped": stopped,
            "checkpoint": str(left[-1]) if left else None,
            "files": {name: str(path) for name, path in files.items() if path.exists()},
        }

    def _note(self) -> str:
        """How it goes."""
        stages, rate = len(self._plan.stages), self._course.success_rate
        told = [f"stage {self._course.stage + 1} of {stages}"] if stages > 1 else []
        told.append(f"{self._episodes:,} episodes")
        if rate is not None:
            told.append(f"{rate:.0%} success")
        measured = (self._evaluations.last if self._evaluations else {}).get("success_rate")
        if measured is not None:
            told.append(f"{measured:.0%} in the evaluation")
        return ", ".join(told)

    def _chance(self) -> int:
        """The seed of what environments draw from here on."""
        entropy = (self._plan.seed, self.learner.num_timesteps)
        return int(np.random.SeedSequence(entropy).generate_state(1)[0])

    def _open_evaluations(self) -> Evaluations | None:
        if self._plan.evaluation is None:
            return None
        return Evaluations(self._plan, self._folder.evaluations, self.learner.num_timesteps)

    def _good(self) -> str:
        left = checkpoints(self._folder.checkpoints)
        return f"{left[-1]} is whole" if left else "there is no checkpoint yet"


class _Steward(BaseCallback):
    """Has something done before each rollout."""

    def __init__(self, act: Callable[[], None]) -> None:
        super().__init__()
        self._act = act

    def _on_rollout_start(self) -> None:
        self._act()

    def _on_step(self) -> bool:
        return True


class _Log(TensorBoardOutputFormat):
    """TensorBoard's log, in which what comes after a checkpoint gives way to what comes anew."""

    def __init__(self, folder: str, samples: int) -> None:
        self.writer = SummaryWriter(log_dir=folder, purge_step=samples or None)
        self._is_closed = False


def _newest(folder: RunFolder, warn: Callable[[str], None]) -> tuple[Any, Checkpoint] | None:
    """The newest checkpoint that is whole, and its path; None where there is no checkpoint."""
    broken: InputError | None = None
    for path in reversed(checkpoints(folder.checkpoints)):
        try:
            return path, read_checkpoint(path)
        except InputError as error:
            warn(f"{error}; going on from the one before")
            broken = error
    if broken is not None:
        raise broken
    return None


def _read_run(path: Any, checkpoint: Checkpoint) -> dict[str, Any]:
    where = Where(path).at("run")
    run = read_fields(_RUN, checkpoint.run, where)
    for name in _RUN.keys() - run.keys():
        raise where.at(name).error("a value", "none")
    return run
