"""A training run: it alternates rollouts and updates, and writes all files of the run.

A pretraining, if the plan has one, comes before the first rollout.
"""

from __future__ import annotations

import errno
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger, TensorBoardOutputFormat
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm
from torch.utils.tensorboard import SummaryWriter

from albot_agents.trained.agent_file import (
    LARGEST_LOG_STD,
    LARGEST_WEIGHT,
    AgentFile,
    TrainingFacts,
    read_agent,
)
from albot_agents.training.checkpoint import (
    AgentExporter,
    Checkpoint,
    checkpoints,
    learnt_tensors,
    newest_checkpoint,
    restore,
    take_checkpoint,
)
from albot_agents.training.claims import ClaimTraining
from albot_agents.training.curriculum import Curriculum
from albot_agents.training.evaluations import Evaluations
from albot_agents.training.journeys import MadeJourneys
from albot_agents.training.learner import make_learner
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.pretraining import Pretraining
from albot_agents.training.run_files import EpisodeLog, RunFolder, machine_facts
from albot_core.errors import InputError
from albot_core.plain_data import Location, read_record
from albot_core.ranges import NOT_NEGATIVE

_DISK_FULL_ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_LOGARITHMS = ("log_std", "log_ent_coef")
"""Weights that are logarithms: PPO's standard deviations, SAC's coefficient of the entropy."""
_ROUND_STEPS = 32
"""Steps of all environments between two looks at an off-policy run, whose rollouts are too short: a
snapshot of all weights costs as much as an update of small networks."""
_RUN = dict.fromkeys(("stage", "stage_began", "monitor", "episodes"), int) | {"seconds": float}
"""The state of a run in a checkpoint: the stage, the samples at its beginning, the size of the
episode log (bytes), and the episodes and seconds so far."""

ProgressReport = Callable[[int, str], None]
"""Called with the number of samples so far, and the state of the training as text."""


class TrainingRun:
    """A training run, new or resumed.

    Args:
        folder: The run's folder, after `RunFolder.begin` or `RunFolder.resume`.
        plan: The plan.
        warn: Called with a sentence about each problem that does not stop the run.
        made: Journeys that need not be made before the training; emptied when they are kept.
        on_journeys: Called with these and those that were made, before that.

    Raises:
        InputError: An environment cannot be made, or a file of the run is damaged.
    """

    def __init__(
        self,
        folder: RunFolder,
        plan: TrainingPlan,
        warn: Callable[[str], None] = lambda text: None,
        *,
        made: MadeJourneys | None = None,
        on_journeys: Callable[[MadeJourneys], None] = lambda made: None,
    ) -> None:
        self._folder, self._plan, self._command = folder, plan, folder.command
        self._made, self._on_journeys = made, on_journeys
        self._report: ProgressReport = lambda done, note: None
        self._warn = warn
        found = newest_checkpoint(folder.checkpoints, warn)
        self._resumed = dict.fromkeys(_RUN, 0) | ({} if found is None else _read_run(*found))
        self._exporter = AgentExporter(plan)
        self._curriculum = Curriculum(
            plan, int(self._resumed["stage"]), float(self._resumed["seconds"])
        )
        self.learner: BaseAlgorithm = make_learner(
            plan, self._curriculum, self._exporter.network.encoders
        )
        """The learner."""
        if found is not None:
            path, checkpoint = found
            restore(self.learner, checkpoint, path)
            self._warn_if_nothing_is_learnt()
            self._curriculum.seed(self._next_seed())
        # The first checkpoint comes after the pretraining.
        self._pretrains = found is None and plan.pretrain is not None
        self._figures: dict[str, float | int | None] = {}
        self._claims: dict[str, float | int | None] = {}
        self._stage_began = int(self._resumed["stage_began"])
        self._began_at = self._saved_at = self.learner.num_timesteps
        self._evaluations = self._open_evaluations()
        # From here on, the folder counts as that of a run.
        self._episode_log = EpisodeLog(folder.monitor, plan.task, int(self._resumed["monitor"]))
        self._snapshot = self._take_snapshot()

    def _warn_if_nothing_is_learnt(self) -> None:
        """Warn if the resumed run ends before its replay buffer is filled again."""
        samples, last = self.learner.num_timesteps, self._plan.n_timesteps
        first = getattr(self.learner, "learning_starts", 0)  # On-policy learners have none.
        if samples < last <= first:
            self._warn(
                f"{self._folder.path}: nothing more is learnt before {first:,} samples; use --steps"
            )

    def run(self, report: ProgressReport | None = None) -> dict[str, Any]:
        """Train to the end or until Ctrl-C; return the outcome, as `albot train --json` prints it.

        Args:
            report: Called with the progress.

        Raises:
            InputError: The disk is full, or the training diverges; the last good checkpoint is
                intact.
        """
        stopped, self._report = False, report or self._report
        log = _TensorBoardLog(str(self._folder.tensorboard), self.learner.num_timesteps)
        self.learner.set_logger(Logger(str(self._folder.tensorboard), [log]))
        try:
            remaining = self._plan.n_timesteps - self.learner.num_timesteps
            if remaining > 0:
                self._prepare_journeys()
                if self._pretrains:
                    self._pretrain()
                self._evaluate_clone()
                callback = _RolloutCallback(self._between_rollouts, self._rollouts_of_round)
                # None, because an off-policy learner would log every few episodes within a step.
                log_interval: Any = None if self._plan.learns_off_policy else 1
                self.learner.learn(
                    remaining, callback, log_interval=log_interval, reset_num_timesteps=False
                )
            self._between_rollouts(last=True)
            self._learn_claims()
        except KeyboardInterrupt:
            stopped = True
            if not self._pretrains:
                self._save()
        except (ValueError, RuntimeError):
            # Torch refuses distributions with such weights, in the midst of an update.
            self._check_weights()
            raise
        except OSError as error:
            if error.errno not in _DISK_FULL_ERRORS:
                raise
            found = f"{error.strerror}; {self._last_checkpoint()}"
            raise InputError(self._folder.path, "free disk space", found) from None
        finally:
            log.close()
            self.close()
        return self._result(stopped)

    @property
    def evaluated(self) -> dict[str, list[float]]:
        """The evaluations so far, as `Evaluations.curve`; empty if the plan has none."""
        return {} if self._evaluations is None else self._evaluations.curve

    def close(self) -> None:
        """Close the environments; `run` calls it."""
        self._curriculum.close()
        if self._evaluations is not None:
            self._evaluations.close()

    def _prepare_journeys(self) -> None:
        """Make the journeys that the environments will draw."""
        samples = self.learner.num_timesteps
        made = MadeJourneys() if self._made is None else self._made
        for each in (self._curriculum, self._evaluations):
            if each is not None:
                each.prepare_journeys(lambda note: self._report(samples, note), made)
        self._on_journeys(made)
        made.clear()  # The process's cache has them, and decides what is dropped.

    def _pretrain(self) -> None:
        """Let the policy learn from demonstrations."""
        assert isinstance(self.learner, OnPolicyAlgorithm), "others are refused with the plan"
        path = self._folder.demonstrations
        pretraining = Pretraining(self._plan, self.learner, path, self._warn)
        self._figures = pretraining.run(lambda note: self._report(0, note))
        for name, value in self._figures.items():
            if value is not None:
                self.learner.logger.record(f"pretrain/{name}", value)
        self._check_weights()
        self._snapshot = self._take_snapshot()
        self._save()
        self._pretrains = False

    def _evaluate_clone(self) -> None:
        """Evaluate what the pretraining has learnt, unless that was done before a stop."""
        if self._plan.pretrain is None or self.learner.num_timesteps or self._evaluations is None:
            return
        if not self._evaluations.count:
            self._evaluate(self._evaluations)

    def _learn_claims(self) -> None:
        """Let the agents that were saved learn when to claim, if the plan says so."""
        if self._plan.claims is None:
            return
        samples, training = self.learner.num_timesteps, ClaimTraining(self._plan)
        for path in (self._folder.best, self._folder.last):
            # In a resumed run the best agent may have learnt it already.
            if path.exists() and read_agent(path).network == self._exporter.network:
                report = partial(self._report, samples)
                self._claims = training.teach(path, report)

    def _between_rollouts(self, last: bool = False) -> None:
        """Change the stage, evaluate and save where due, between two rounds and at the end."""
        samples = self.learner.num_timesteps
        self._check_weights()
        self._episode_log.add(self._curriculum.take_rows())
        if self._curriculum.is_over(samples - self._stage_began) and not last:
            self._next_stage()
        if isinstance(self.learner, OffPolicyAlgorithm):
            if self.learner.ep_info_buffer is not None:  # None if the run was over already.
                self.learner.dump_logs()
        elif isinstance(self.learner, OnPolicyAlgorithm):
            self._set_entropy_coefficient(self.learner)
        self._snapshot = self._take_snapshot()
        self._maybe_evaluate(last)
        if last or samples - self._saved_at >= self._plan.checkpoint_every:
            self._save()
        self._report(samples, self._progress_note())

    def _check_weights(self) -> None:
        """Raise InputError if the training has diverged: no agent file may hold such weights."""
        for name, value in learnt_tensors(self.learner).items():
            most = LARGEST_LOG_STD if name in _LOGARITHMS else LARGEST_WEIGHT
            if not bool((value.abs() <= most).all()):
                expected = f"weights within ±{most:g}; a smaller learning_rate may help"
                samples = f"after {self.learner.num_timesteps:,} samples"
                found = f"others in {name} {samples}; {self._last_checkpoint()}"
                raise InputError(self._folder.path, expected, found)

    def _next_stage(self) -> None:
        """Continue in the next stage's environments."""
        learner, samples = self.learner, self.learner.num_timesteps
        begun = self._curriculum.next_stage(
            self._next_seed(), lambda note: self._report(samples, note)
        )
        learner._last_obs = begun  # type: ignore[assignment]
        learner._last_episode_starts = np.ones(self._plan.n_envs, np.bool_)
        self._stage_began = samples

    def _set_entropy_coefficient(self, learner: OnPolicyAlgorithm) -> None:
        """Set the coefficient by its schedule; stable-baselines3 handles the other schedules."""
        remaining = 1 - learner.num_timesteps / self._plan.n_timesteps
        learner.ent_coef = self._plan.schedule("ent_coef")(max(0.0, remaining))

    def _maybe_evaluate(self, last: bool) -> None:
        """Evaluate the policy if an evaluation is due, and save it if it is the best so far."""
        evaluation, evaluations = self._plan.evaluation, self._evaluations
        samples = self.learner.num_timesteps
        if evaluation is None or evaluations is None:
            return
        if samples - evaluations.samples < (1 if last else evaluation.every):
            return
        self._evaluate(evaluations)

    def _evaluate(self, evaluations: Evaluations) -> None:
        """Evaluate the policy, and save it if it is the best so far."""
        best = evaluations.measure(self.learner)
        for name, value in evaluations.last.items():
            if value is not None:
                self.learner.logger.record(f"eval/{name}", value)
        self.learner.logger.dump(self.learner.num_timesteps)
        if best:
            self._export().save(self._folder.best)

    def _take_snapshot(self) -> Checkpoint:
        run = {
            "stage": self._curriculum.stage,
            "stage_began": self._stage_began,
            "monitor": self._episode_log.size,
            "seconds": self._curriculum.elapsed,
            "episodes": self._episodes,
        }
        return take_checkpoint(self.learner, run)

    def _save(self) -> None:
        """Write the last snapshot as a checkpoint, and its policy as an agent."""
        self._snapshot.save(self._folder.checkpoints)
        self._saved_at = self._snapshot.samples
        self._export().save(self._folder.last)

    def _export(self) -> AgentFile:
        """Return the agent of the last snapshot."""
        snapshot = self._snapshot
        facts = TrainingFacts(
            plan=self._plan,
            command=self._command,
            samples=snapshot.samples,
            episodes=snapshot.run["episodes"],
            seconds=round(snapshot.run["seconds"], 1),
            curve=(self._evaluations or self._episode_log).curve,
            **machine_facts(),
        )
        return self._exporter.agent(snapshot.weights, facts)

    @property
    def _rollouts_of_round(self) -> int:
        """Rollouts between two looks at the run."""
        if not self._plan.learns_off_policy:
            return 1
        return max(1, _ROUND_STEPS // self._plan.off_policy.train_freq)

    @property
    def _episodes(self) -> int:
        """Episodes since the training began."""
        return int(self._resumed["episodes"]) + self._curriculum.episodes

    def _result(self, stopped: bool) -> dict[str, Any]:
        """Return the outcome, as `albot train --json` prints it."""
        samples, curriculum = self.learner.num_timesteps, self._curriculum
        seconds = curriculum.elapsed - float(self._resumed["seconds"])
        left = checkpoints(self._folder.checkpoints)
        files = {"best": self._folder.best, "last": self._folder.last}
        return {
            "task": self._plan.task,
            "algorithm": self._plan.algorithm,
            "seed": self._plan.seed,
            "folder": str(self._folder.path),
            "samples": self._snapshot.samples,
            "episodes": self._snapshot.run["episodes"],
            "stage": curriculum.stage,
            "pretraining": self._figures,
            "claims": self._claims,
            "seconds": seconds,
            "samples_per_second": (samples - self._began_at) / seconds,
            "environment_share": curriculum.step_seconds / seconds,
            "device": str(self.learner.device),
            "success_rate": curriculum.success_rate,
            "evaluation": self._evaluations.last if self._evaluations else {},
            "stopped": stopped,
            "checkpoint": str(left[-1]) if left else None,
            "files": {name: str(path) for name, path in files.items() if path.exists()},
        }

    def _progress_note(self) -> str:
        """Return the state of the training as text."""
        stages, rate = len(self._plan.stages), self._curriculum.success_rate
        notes = [f"stage {self._curriculum.stage + 1} of {stages}"] if stages > 1 else []
        notes.append(f"{self._episodes:,} episodes")
        mean_return = self._curriculum.mean_return
        if mean_return is not None:
            notes.append(f"return {mean_return:.2f}")
        if rate is not None:
            notes.append(f"{rate:.0%} success")
        measured = (self._evaluations.last if self._evaluations else {}).get("success_rate")
        if measured is not None:
            notes.append(f"{measured:.0%} in the evaluation")
        return ", ".join(notes)

    def _next_seed(self) -> int:
        """Return the environments' seed from the current sample on."""
        entropy = (self._plan.seed, self.learner.num_timesteps)
        return int(np.random.SeedSequence(entropy).generate_state(1)[0])

    def _open_evaluations(self) -> Evaluations | None:
        if self._plan.evaluation is None:
            return None
        return Evaluations(self._plan, self._folder.evaluations, self.learner.num_timesteps)

    def _last_checkpoint(self) -> str:
        left = checkpoints(self._folder.checkpoints)
        return f"{left[-1]} is intact" if left else "there is no checkpoint yet"


class _RolloutCallback(BaseCallback):
    """Calls a function before the first of every so many rollouts."""

    def __init__(self, act: Callable[[], None], every: int) -> None:
        super().__init__()
        self._act, self._every, self._begun = act, every, 0

    def _on_rollout_start(self) -> None:
        if self._begun % self._every == 0:
            self._act()
        self._begun += 1

    def _on_step(self) -> bool:
        return True


class _TensorBoardLog(TensorBoardOutputFormat):
    """TensorBoard's log; on resuming, entries after the checkpoint are dropped."""

    def __init__(self, folder: str, samples: int) -> None:
        self.writer = SummaryWriter(log_dir=folder, purge_step=samples or None)
        self._is_closed = False


def _read_run(path: Any, checkpoint: Checkpoint) -> dict[str, Any]:
    where = Location(path).at("run")
    run = read_record(_RUN, checkpoint.run, where)
    for name, value in run.items():
        if value not in NOT_NEGATIVE:
            raise where.at(name).error(NOT_NEGATIVE.expected, str(value))
    return run
