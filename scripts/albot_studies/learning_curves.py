"""Curves of learning: how well a network does each new task, after how many samples.

In each task a network learns from the task's scripted agent (`albot_agents.training.imitation`), in
offices of four rooms, and is measured in others. Beside it stand the scripted agent, an agent that
stands still, and the same networks before they learnt anything.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import gymnasium
import numpy as np
from jaxtyping import Int64

from albot_agents.agent import EnvironmentConfigs
from albot_agents.evaluation.plan import parse_seeds
from albot_cli.count_type import CountType
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.drawing.palette import BELIEVED, HOME, PARTICLE, TRUTH, WALL
from albot_core.errors import InputError
from albot_core.evaluation.intervals import bootstrap_clusters
from albot_core.files import atomic_write, write_text
from albot_maps import WorldSet, load_world
from albot_maps.generators.spec import seeded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from albot_agents.training.imitation import Actions, Imitator
    from albot_agents.training.teachers import Observations, Teachers

LINES = (("scripted", WALL, "--"), ("untrained", PARTICLE, ":"), ("still", HOME, "-."))
"""Who stands beside the network, with the colour and the style of its line."""
WORLDS = "random:office?rooms=4"
"""Kind of the worlds."""


@dataclass(frozen=True, kw_only=True)
class Lesson:
    """A task to learn, and from whom."""

    teacher: str
    """Name of the scripted agent."""
    limit: int
    """Number of steps after which episodes end."""
    config: Mapping[str, Any] = field(default_factory=dict)
    """The task's configuration."""
    robots: int = 8
    """Number of robots that drive at the same time in training. Long episodes need more, or too few
    are seen."""
    updates: int = 400
    """Number of updates of the weights after each round."""
    journeys: Mapping[str, Any] = field(default_factory=dict)
    """The number of journeys, where there are any."""


_OUTING = {"shortest": 10.0, "longest": 40.0}
_PATCH = {"sides": [16.0], "channels": ["walls", "free", "trail", "home"]}
LESSONS = {
    "Albot/Explore-v0": Lesson(
        teacher="gap-explorer",
        limit=900,
        robots=32,
        updates=800,
        config={
            "observations": {
                "parts": ["laser", "motion", "heading", "home", "coverage", "frontier", "matches"]
            }
        },
    ),
    "Albot/Homing-v0": Lesson(
        teacher="albot1-homing",
        limit=400,
        config={
            "claims": True,
            "outing": _OUTING,
            "observations": {
                "parts": ["laser", "motion", "heading", "home", "exit", "way", "matches"]
            },
        },
        journeys={"journeys": 1},
    ),
    "Albot/HomingByMap-v0": Lesson(
        teacher="patch-homing",
        limit=400,
        config={
            "outing": _OUTING,
            "observations": {
                "parts": ["laser", "motion", "heading", "home", "map_patch", "matches"],
                "map_patch": _PATCH,
            },
        },
        journeys={"journeys": 1},
    ),
    "Albot/ExploreAndHome-v1": Lesson(
        teacher="round-trip",
        limit=600,
        robots=32,
        updates=800,
        config={
            "shortest": 40.0,
            "longest": 60.0,
            "ground": 10.0,
            "observations": {
                "parts": [
                    "laser", "motion", "heading", "home", "coverage", "frontier", "time_left",
                    "map_patch", "matches",
                ],
                "map_patch": _PATCH,
            },
        },
    ),
}  # fmt: skip
"""The tasks in which the agent drives."""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is learnt and measured."""

    worlds: str = WORLDS
    """Kind of the worlds, without seeds."""
    train: range = range(2000, 2032)
    test: range = range(3000, 3016)
    """Seeds of the worlds in which the networks learn, and of those in which they are measured."""
    steps: int = 300
    """Steps of each robot in a round."""
    rounds: tuple[int, ...] = (1, 2, 4, 8)
    """Numbers of rounds after which the network is measured."""
    taught: float = 0.25
    """Share of the robots that the teacher drives, after the first round."""
    seeds: int = 3
    """Number of networks, each with its own seed."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """The outcome of an episode."""

    world: str
    earned: float
    """Sum of the rewards."""
    success: bool | None
    """Whether the task was done; None if it has no end."""
    right_claims: int
    false_claims: int


Policy = Callable[["Observations", Int64[np.ndarray, "robots"]], "Actions"]
"""Returns the actions of some robots for their observations."""


def make_batch(task: str, lesson: Lesson, worlds: Any, robots: int) -> Any:
    """Make a batch of a lesson's environments."""
    return gymnasium.make_vec(
        task,
        num_envs=robots,
        world=worlds,
        mapper="albot1",
        observation="dict",
        autoreset_mode="SameStep",
        max_episode_steps=lesson.limit,
        config=lesson.config,
        threads=1,
        **lesson.journeys,
    )


class Classroom:
    """The environments in which the networks of a task learn and are measured.

    Args:
        task: Id of the task.
        plan: How much is learnt and measured.
    """

    def __init__(self, task: str, plan: Plan) -> None:
        self.lesson, self.plan = LESSONS[task], plan
        each = [seeded(plan.worlds, seed) for seed in (*plan.train, *plan.test)]
        train, test = each[: len(plan.train)], each[len(plan.train) :]
        self._test_worlds = test
        self._train = make_batch(
            task, self.lesson, WorldSet(tuple(map(load_world, train))), self.lesson.robots
        )
        self._test = make_batch(task, self.lesson, test, len(test))
        single = gymnasium.make(task, world=train[0], mapper="albot1", config=self.lesson.config)
        self._configs, self._actions = EnvironmentConfigs.of(single), single.action_space
        self.names = self._configs.actions.names

    def teachers(self, robots: int) -> Teachers:
        """Return a scripted agent for each of some robots."""
        from albot_agents.training.teachers import Teachers  # slow to load

        return Teachers(self.lesson.teacher, self._configs, self._actions, robots)

    def learn(self, seed: int) -> Iterator[tuple[int, Imitator]]:
        """Let a network learn; yield the number of samples and the network where it is measured."""
        from albot_agents.training.imitation import Imitator  # slow to load

        plan, lesson = self.plan, self.lesson
        imitator = Imitator(self._configs.observations.shapes, len(self.names), seed)
        yield 0, imitator
        teachers, robots = self.teachers(lesson.robots), np.arange(lesson.robots)
        observations, _ = self._train.reset(seed=1000 * seed)
        for done in range(1, plan.rounds[-1] + 1):
            taught = robots < lesson.robots * (1.0 if done == 1 else plan.taught)
            for _ in range(plan.steps):
                wanted = teachers.act(observations, robots)
                imitator.remember(observations, wanted)
                actions = np.where(taught[:, None], wanted, imitator.act(observations))
                observations, _, terminated, truncated, _ = self._train.step(actions)
                teachers.reset(terminated | truncated)
            imitator.learn(lesson.updates)
            if done in plan.rounds:
                yield done * plan.steps * lesson.robots, imitator

    def measure(self, policy: Policy) -> list[Score]:
        """Let a policy act in one episode of each test world."""
        envs, worlds = self._test, self._test_worlds
        observations, _ = envs.reset(seed=self.plan.test[0])
        earned, at_work = np.zeros(len(worlds)), np.ones(len(worlds), np.bool_)
        scores: dict[int, Score] = {}
        while at_work.any():
            actions = self.still(observations, np.arange(len(worlds)))
            robots = np.flatnonzero(at_work)
            actions[at_work] = policy(
                {part: row[at_work] for part, row in observations.items()}, robots
            )
            observations, reward, terminated, truncated, info = envs.step(actions)
            earned[at_work] += reward[at_work]
            for k in np.flatnonzero(at_work & (terminated | truncated)).tolist():
                end = info["final_info"]
                scores[k] = Score(
                    world=worlds[k],
                    earned=float(earned[k]),
                    success=bool(end["is_success"][k]) if "is_success" in end else None,
                    right_claims=int(end["right_claims"][k]),
                    false_claims=int(end["false_claims"][k]),
                )
            at_work &= ~(terminated | truncated)
        return [scores[k] for k in range(len(worlds))]

    def still(self, observations: Observations, robots: Int64[np.ndarray, "robots"]) -> Actions:
        """Return actions that stand still and say nothing."""
        action = [0.0, 0.0] + [-1.0] * (len(self.names) - 2)
        return np.tile(np.array(action, np.float32), (len(robots), 1))

    def close(self) -> None:
        """Close the environments."""
        self._train.close()
        self._test.close()


def measure(tasks: Sequence[str], plan: Plan) -> list[dict[str, Any]]:
    """Let networks learn the tasks; return one row per line and per point of the curves."""
    import torch  # slow to load

    torch.set_num_threads(1)  # More of them only wait for each other in networks of this size.
    rows = []
    parts = 2 + plan.seeds * (1 + len(plan.rounds))
    with progress("learning", len(tasks) * parts, "measurements") as tell:
        for number, task in enumerate(tasks):
            room, done = Classroom(task, plan), number * parts
            tell(done, f"{task}, scripted")
            teachers = room.teachers(len(plan.test))
            rows.append(_row(task, "scripted", None, room.measure(teachers.act)))
            rows.append(_row(task, "still", None, room.measure(room.still)))
            points: dict[int, list[Score]] = {}
            for seed in range(plan.seeds):
                for samples, imitator in room.learn(seed):
                    done += 1
                    tell(done + 1, f"{task}, network {seed}, {samples} samples")
                    scores = room.measure(_policy(imitator))
                    points.setdefault(samples, []).extend(scores)
            for samples, scores in points.items():
                name = "learner" if samples else "untrained"
                rows.append(_row(task, name, samples, scores))
            room.close()
    return rows


def _policy(imitator: Imitator) -> Policy:
    return lambda observations, _: imitator.act(observations)


def _row(task: str, agent: str, samples: int | None, scores: list[Score]) -> dict[str, Any]:
    """Return the means of episodes; episodes in the same world are not independent."""
    worlds = [score.world for score in scores]

    def mean(values: Sequence[float]) -> list[float]:
        measured = np.array(values, np.float64)
        interval = bootstrap_clusters(measured, worlds, np.random.default_rng(0))
        return [round(float(value), 3) for value in (measured.mean(), *interval)]

    does_end = scores[0].success is not None
    return {
        "task": task,
        "agent": agent,
        "samples": samples,
        "episodes": len(scores),
        "return": mean([score.earned for score in scores]),
        "success": mean([bool(score.success) for score in scores]) if does_end else None,
        "right_claims": mean([score.right_claims for score in scores]),
        "false_claims": mean([score.false_claims for score in scores]),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as Markdown, one table per task."""
    lines = []
    for task in dict.fromkeys(row["task"] for row in rows):
        lines += [
            f"### {task}",
            "",
            "| agent | samples | return (95 %) | success (95 %) | right, false claims an episode |",
            "|---|---|---|---|---|",
        ]
        for row in (row for row in rows if row["task"] == task):
            samples = "" if row["samples"] is None else f"{row['samples']:,}"
            success = "–" if row["success"] is None else _cell(row["success"], ".0%")
            claims = f"{row['right_claims'][0]:.2f}, {row['false_claims'][0]:.2f}"
            cells = row["agent"], samples, _cell(row["return"], ".1f"), success, claims
            lines.append(f"| {' | '.join(cells)} |")
        lines.append("")
    return "\n".join(lines)


def _cell(figures: Sequence[float], style: str) -> str:
    mean, low, high = (format(figure, style) for figure in figures)
    return f"{mean} ({low} to {high})"


def draw(rows: Sequence[dict[str, Any]], out: Path) -> None:
    """Draw return, success and claims against samples, a column of panels for each task."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # slow to load
    from matplotlib.figure import Figure

    tasks = list(dict.fromkeys(row["task"] for row in rows))
    figure = Figure(figsize=(3.4 * len(tasks) + 1.4, 7.2), layout="constrained")
    panels = np.reshape(figure.subplots(3, len(tasks), sharex="col"), (3, len(tasks)))
    for column, task in enumerate(tasks):
        its = [row for row in rows if row["task"] == task]
        panels[0, column].set_title(task, fontsize=10)
        panels[2, column].set_xlabel("samples, thousands")
        for axes, name in zip(
            panels[:, column], ("return", "success", "right_claims"), strict=True
        ):
            _draw_curve(axes, its, name, TRUTH, "network")
            if name == "right_claims":
                _draw_curve(axes, its, "false_claims", BELIEVED, "network, false claims")
            axes.grid(alpha=0.3)
    for axes, label in zip(panels[:, 0], ("return", "success", "claims an episode"), strict=True):
        axes.set_ylabel(label)
    figure.legend(
        *panels[2, 0].get_legend_handles_labels(),
        loc="outside lower center",
        ncols=5,
        frameon=False,
    )
    FigureCanvasAgg(figure)
    with atomic_write(out) as stream:
        figure.savefig(stream, format="png", dpi=100)


def _draw_curve(
    axes: Axes, rows: Sequence[dict[str, Any]], name: str, colour: str, label: str
) -> None:
    """Draw a curve of the network, and the lines of the others unless they were never right."""
    if rows[0][name] is None:
        axes.text(0.5, 0.5, "no end", ha="center", transform=axes.transAxes)
        return
    points = [row for row in rows if row["samples"] is not None]
    samples = [row["samples"] / 1000 for row in points]
    mean, low, high = np.transpose([row[name] for row in points])
    axes.plot(samples, mean, "o-", ms=4, color=colour, label=label)
    axes.fill_between(samples, low, high, color=colour, alpha=0.2, linewidth=0)
    if name == "false_claims":
        return
    for agent, colour, style in LINES:
        level = next(row[name][0] for row in rows if row["agent"] == agent)
        axes.plot(samples[:: len(samples) - 1], [level] * 2, style, color=colour, label=agent)


@click.command()
@click.option("--task", "tasks", multiple=True, type=click.Choice(list(LESSONS)), help="Only this.")
@click.option("--worlds", default=Plan.worlds, show_default=True, help="Kind of the worlds.")
@click.option("--train", default="2000..2031", show_default=True, help="Worlds to learn in.")
@click.option("--test", default="3000..3015", show_default=True, help="Worlds to be measured in.")
@click.option("--rounds", default=Plan.rounds[-1], show_default=True, type=CountType(1))
@click.option("--steps", default=Plan.steps, show_default=True, type=CountType(1))
@click.option("--networks", default=Plan.seeds, show_default=True, type=CountType(1))
@click.option("--out", type=PathType(), help="File for the tables, as Markdown.")
@click.option("--png", type=PathType(), help="File for the picture.")
@JSON
def command(
    tasks: tuple[str, ...],
    worlds: str,
    train: str,
    test: str,
    rounds: int,
    steps: int,
    networks: int,
    out: Path | None,
    png: Path | None,
    as_json: bool,
) -> None:
    """Measure how networks learn each task from its scripted agent."""
    plan = Plan(
        worlds=worlds,
        train=parse_seeds(train, "--train"),
        test=parse_seeds(test, "--test"),
        rounds=tuple(sorted({rounds, *(each for each in Plan.rounds if each < rounds)})),
        steps=steps,
        seeds=networks,
    )
    shared = set(plan.train) & set(plan.test)
    if shared:
        raise InputError("--test", "other worlds than those of --train", f"{min(shared)} in both")
    rows = measure(tasks or tuple(LESSONS), plan)
    if out is not None:
        write_text(out, table(rows))
    if png is not None:
        draw(rows, png)
    click.echo(json.dumps({"rows": rows}) if as_json else table(rows))
