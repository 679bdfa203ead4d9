"""The probes: agents in the scenes in which animals and people were tested, held against chance."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from typing import TYPE_CHECKING, Any

import numpy as np

from albot_agents.engine.choice import make_engine
from albot_agents.engine.engine import Engine
from albot_agents.evaluation.plan import Trial as Episode
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_agents.registry import check_agent, find_agent
from albot_core.drawing.palette import TRUTH, WALL
from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from albot_core.geometry.poses import wrap_angle
from albot_env.tasks.probe.scenes import Scene, Trial
from albot_env.tasks.probe.task import PROBES, ProbeConfig
from albot_experiments.drawing import MARK, PATH, draw_floor, finish_maps
from albot_experiments.report import Figures, Report
from albot_maps import load_world

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AGENTS = ("oracle", "albot1-homing", "patch-homing", "homing", "path-integration")
"""The agents that are compared unless one is asked for; `oracle` knows the truth."""
JUDGED = "albot1-homing"
"""The agent whose verdict is the experiment's."""
STEPS = 1500
"""Time limit (steps of 0.1 s)."""
PAPERS: Mapping[str, Mapping[str, Figures]] = {
    # 36 % of the rats chose the path to the food (Tolman, Cognitive maps in rats and men, 1948).
    "Albot/Probe-Sunburst-v0": {"right": 0.36},
}
"""What papers report under the names of our figures, by task."""


def run(
    task: str,
    seeds: range,
    progress: Callable[[int], None] = lambda done: None,
    *,
    agent: str | None = None,
    mapper: str | None = None,
    odometer: str = "pioneer",
    engine: Engine | None = None,
) -> Report:
    """Run agents through the trials of a probe in turn, an episode a seed.

    Args:
        task: Id of the probe's environment.
        seeds: The seeds, of which the k-th meets the k-th trial.
        progress: Called with the number of seeds done with every agent.
        agent: The only agent beside the oracle; None for `AGENTS`.
        mapper: The mapper of agents that know no truth; None for each agent's own.
        odometer: The odometer.
        engine: Runs the episodes; None for processes, one a core.

    Raises:
        InputError: No seeds; or there is no such agent, mapper or odometer, or the agent cannot
            attempt a probe.
    """
    if not len(seeds):
        raise InputError("seeds", "at least one seed", "none")
    judged = agent or JUDGED
    agents = tuple(dict.fromkeys((AGENTS[0], agent))) if agent else AGENTS
    for name in agents:
        check_agent(name, task)
    scene = PROBES[task].scene
    episodes: list[Episode] = []
    for k, seed in enumerate(seeds):
        trial = list(scene.trials)[k % len(scene.trials)]
        for name in agents:
            settings: dict[str, Any] = {"odometer": odometer, "max_episode_steps": STEPS}
            settings["config"] = ProbeConfig(trial=trial)
            if mapper is not None and name != AGENTS[0]:
                settings["mapper"] = mapper
            made = find_agent(name).environment(task, settings)
            episodes.append(
                Episode(task=task, agent=name, world=scene.world, seed=seed, settings=made)
            )
    episodes[-1].make().close()  # Invalid settings raise before the work begins.
    outcomes: dict[str, list[Outcome]] = {name: [] for name in agents}
    with closing((engine or make_engine()).run(run_trial, episodes)) as results:
        for count, done in enumerate(results, start=1):
            episode = done.task
            outcome = done.required(f"{task} in {episode.world}, seed {episode.seed}")
            outcomes[episode.agent].append(outcome)
            progress(count // len(agents))
    for some in outcomes.values():
        some.sort(key=lambda outcome: outcome.trial.seed)
    return _report(task, scene, seeds, outcomes, judged)


def is_right(scene: Scene, outcome: Outcome) -> bool:
    """Return whether a robot chose rightly, or came home where nothing is to be chosen."""
    trial = _trial(scene, outcome)
    if trial.right:
        return outcome.info["choice"] in trial.right
    return bool(outcome.info["is_success"])


def chance_of(scene: Scene, outcome: Outcome) -> float:
    """Return the probability that a robot that chooses at random is right in an episode.

    Where nothing is to be chosen, it knows how far home is, but draws the direction.
    """
    trial = _trial(scene, outcome)
    if trial.right:
        return len(trial.right) / len(scene.choices)
    distance = float(np.hypot(*(outcome.start - outcome.begin)[:2]))
    radius = ProbeConfig().radius
    return 2 * math.asin(min(1.0, radius / (2 * distance))) / math.pi


def is_above_chance(scene: Scene, outcomes: Sequence[Outcome]) -> bool:
    """Return whether the 95 % interval of the share of right choices lies above chance."""
    right = sum(is_right(scene, outcome) for outcome in outcomes)
    chance = float(np.mean([chance_of(scene, outcome) for outcome in outcomes]))
    return wilson(right, len(outcomes))[0] > chance


def _trial(scene: Scene, outcome: Outcome) -> Trial:
    return scene.trials[outcome.info["trial"]]


def _report(
    task: str,
    scene: Scene,
    seeds: range,
    outcomes: Mapping[str, list[Outcome]],
    judged: str,
) -> Report:
    measured: dict[str, Figures] = {"seeds": len(seeds)}
    measured |= {name: _figures(scene, outcomes[judged])[name] for name in ("right", "chance")}
    worlds = {trial.world for trial in scene.trials.values()}
    for agent, some in outcomes.items():
        measured[agent] = _figures(scene, some)
        for name in scene.trials if len(worlds) > 1 else ():
            of_trial = [each for each in some if each.info["trial"] == name]
            if of_trial:
                measured[f"{agent}, {name}"] = _figures(scene, of_trial)
    verdicts = {agent: is_above_chance(scene, some) for agent, some in outcomes.items()}
    files = {agent: find_agent(agent).file for agent in outcomes}
    return Report(
        id=experiment_id(task),
        title=scene.title,
        paper=PAPERS.get(task, {}),
        measured=measured,
        holds=verdicts[judged],
        verdicts=verdicts,
        trained={agent: file.fingerprint for agent, file in files.items() if file is not None},
        text=_text(scene, seeds),
        pictures={"paths": _picture(scene, outcomes)},
    )


def experiment_id(task: str) -> str:
    """Return the experiment's name in the command: `probe-detour` for `Albot/Probe-Detour-v0`."""
    from albot_agents.task import short_name

    return short_name(task)


def _figures(scene: Scene, outcomes: Sequence[Outcome]) -> dict[str, Figures]:
    """Return the figures of an agent, over episodes."""
    right = [is_right(scene, outcome) for outcome in outcomes]
    low, high = wilson(sum(right), len(right))
    infos = [outcome.info for outcome in outcomes]
    figures: dict[str, Figures] = {
        "episodes": len(outcomes),
        "right": round(float(np.mean(right)), 3),
        "low": round(low, 3),
        "high": round(high, 3),
        "chance": round(float(np.mean([chance_of(scene, each) for each in outcomes])), 3),
        "home": round(float(np.mean([info["is_success"] for info in infos])), 3),
        "spl": round(float(np.mean([info["spl"] for info in infos])), 3),
        "end_m": round(float(np.median([info["distance_home"] for info in infos])), 2),
    }
    if scene.choices:
        for choice in _told(scene):
            figures[choice] = round(float(np.mean([i["choice"] == choice for i in infos])), 3)
    else:
        turns, lengths = zip(*map(_response, outcomes), strict=True)
        figures["turn_error_deg"] = round(float(np.median(np.abs(turns))), 1)
        figures["length_ratio"] = round(float(np.median(lengths)), 2)
    return figures


def _told(scene: Scene) -> tuple[str, ...]:
    """Return the choices that the table tells: all, or of very many the right ones."""
    if len(scene.choices) <= 4:
        return tuple(scene.choices)
    return tuple(dict.fromkeys(name for trial in scene.trials.values() for name in trial.right))


def _response(outcome: Outcome) -> tuple[float, float]:
    """Return how the way driven differs from that home.

    Returns:
        The angle between the two (degrees, counter-clockwise), and the ratio of their lengths,
        both from the first point to the last.
    """
    wanted = outcome.start[:2] - outcome.begin[:2]
    driven = outcome.path[-1] - outcome.begin[:2]
    angle = math.atan2(driven[1], driven[0]) - math.atan2(wanted[1], wanted[0])
    return math.degrees(wrap_angle(angle)), float(np.hypot(*driven) / np.hypot(*wanted))


def _text(scene: Scene, seeds: range) -> str:
    what = "a right choice" if scene.choices else "coming home and declaring it within 1 m"
    chance = (
        "draws among the choices"
        if scene.choices
        else "knows how far home is and draws the direction"
    )
    return f"""
After {scene.source}.
The robot is led through `{scene.world}` and then drives by itself for {STEPS / 10:g} s at the most,
once for each of the seeds {seeds.start} to {seeds.stop - 1}. The seeds meet the scene's trials,
{len(scene.trials)}, in turn. `right` is the share of {what},
with its 95 % interval (Wilson); `chance` is that of a robot that {chance}.
An agent reaches it if its whole interval lies above chance; this was laid down beforehand. `home`:
share of episodes in which home was declared within 1 m. `end_m`: the median distance from home at
the end. `oracle` knows the truth. Each agent has its own mapper unless another is asked for, and
the hints that it is used to.
"""


def _picture(scene: Scene, outcomes: Mapping[str, list[Outcome]]) -> Figure:
    """Draw the paths of each agent in each world in which it was to come home."""
    from matplotlib.figure import Figure

    worlds = list(dict.fromkeys(trial.world or scene.world for trial in scene.trials.values()))
    width, height = np.ptp(load_world(worlds[0]).walls.reshape(-1, 2), axis=0)
    size = 3.4 * len(outcomes), (3.4 * height / width + 0.7) * len(worlds) + 0.5
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(len(worlds), len(outcomes), squeeze=False)
    for row, world in zip(grid, worlds, strict=True):
        for axes, (agent, some) in zip(row, outcomes.items(), strict=True):
            here = [e for e in some if (_trial(scene, e).world or scene.world) == world]
            _draw(axes, scene, world, here)
            right = sum(is_right(scene, outcome) for outcome in here)
            axes.set_title(f"{agent}: {right} of {len(here)} right", fontsize=9)
    finish_maps(figure)
    return figure


def _draw(axes: Axes, scene: Scene, world: str, outcomes: Iterable[Outcome]) -> None:
    """Draw paths over a world: right ones in one colour, others in another."""
    walls = load_world(world).walls
    draw_floor(axes, walls)
    points = []
    for outcome in outcomes:
        colour = TRUTH if is_right(scene, outcome) else PATH
        axes.plot(
            *outcome.path.T,
            color=colour,
            lw=0.8,
            label="right" if is_right(scene, outcome) else "wrong",
        )
        axes.plot(*outcome.path[0], ".", color=WALL, ms=5, ls="none", label="start")
        axes.plot(*outcome.path[-1], "x", color=colour, ms=5, ls="none")
        axes.plot(
            *outcome.start[:2], "o", mfc="none", mec=MARK, mew=2, ms=9, ls="none", label="home"
        )
        points += [outcome.path, outcome.start[np.newaxis, :2]]
    if points and np.ptp(walls.reshape(-1, 2), axis=0).max() > 60.0:  # An open floor.
        low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
        axes.set(xlim=(low[0] - 1, high[0] + 1), ylim=(low[1] - 1, high[1] + 1))
