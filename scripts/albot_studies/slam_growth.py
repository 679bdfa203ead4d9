"""Time and memory of metric SLAM over many scans: draws docs/images/slam_growth.png.

A robot drives round `office-ring` several times, so that all ground is known after the first lap.
Left: processor time per scan in each lap. Right: memory of `dp-slam` with few and with many
particles (observations of squares), the number of squares seen, and what a separate map for each
particle would hold.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import click
import numpy as np

from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.drawing.figure import save_figure
from albot_core.drawing.palette import SERIES, WALL
from albot_core.mappers.registry import installed_mappers, make_mapper
from albot_core.mappers.slam.dp_slam import DpSlam
from albot_core.mappers.slam.dp_slam_config import DpSlamConfig
from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import StartStop
from albot_experiments.tours import guided_tour
from albot_maps import load_world

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMED: tuple[tuple[str, dict[str, object]], ...] = (
    ("scan-matching", {}),
    ("graph-slam", {}),
    ("graph-slam, no loop closed", {"closures": {"behind": 1_000_000}}),
    ("gmapping", {}),
    ("grid-slam", {}),
    ("dp-slam", {}),
    ("karto", {}),
)
"""The lines on the left: the mapper's name with a remark, and its parameters."""
PARTICLES = (10, 50, 100)
"""Numbers of particles of `dp-slam` that are drawn on the right."""
STEPS = StartStop(move=0.25, turn=np.radians(15.0))
"""Motion of the robot between two scans."""


class Memory(NamedTuple):
    """Memory of `dp-slam` at the end of each lap."""

    particles: int
    """Largest number of particles."""
    observations: list[int]
    """Number of observations in the shared map."""
    ground: list[int]
    """Number of squares seen."""


@click.command()
@click.option("--laps", default=10, show_default=True, type=CountType(2))
@click.option(
    "--out",
    default=Path("docs/images/slam_growth.png"),
    show_default=True,
    type=PathType(),
    help="The picture.",
)
def command(laps: int, out: Path) -> None:
    """Measure the cost of scans lap by lap; print the figures and draw them."""
    rounds = drive_laps(laps)
    timed = {
        line: config for line, config in TIMED if line.partition(",")[0] in installed_mappers()
    }
    costs, memories = {}, []
    with progress("mapping", len(timed) + len(PARTICLES), "runs") as tell:
        for done, (line, config) in enumerate(timed.items()):
            tell(done, line)
            costs[line] = cost_by_lap(line.partition(",")[0], config, rounds)
        for done, particles in enumerate(PARTICLES, start=len(timed)):
            tell(done, f"{particles} particles")
            memories.append(memory_by_lap(particles, rounds))
    scans = list(accumulate(len(lap) for lap in rounds))
    click.echo(f"ms a scan, after {', '.join(map(str, scans))} scans")
    for line, cost in costs.items():
        click.echo(f"{line:28}" + " ".join(f"{1e3 * lap:7.2f}" for lap in cost))
    click.echo("dp-slam at the end of each lap")
    for memory in memories:
        for what, squares in zip(memory._fields[1:], memory[1:], strict=True):
            name = f"{memory.particles} particles, {what}"
            click.echo(f"{name:28}" + " ".join(f"{count:9,}" for count in squares))
    draw(scans, costs, memories, out)
    click.echo(str(out))


def drive_laps(laps: int) -> list[list[Reading]]:
    """Return the robot's readings, lap by lap."""
    world = load_world("office-ring")
    tour = world.tours["single-loop"]
    way = np.concatenate([tour, *[tour[1:]] * (laps - 1)])
    journey = guided_tour(world, way, np.random.default_rng(0), steps=STEPS)
    return [
        [journey.readings[k] for k in lap]
        for lap in np.array_split(np.arange(len(journey.readings)), laps)
    ]


def cost_by_lap(
    name: str, config: dict[str, object], rounds: Sequence[list[Reading]]
) -> list[float]:
    """Return the processor time per scan (s) in each lap, without compilation."""
    warm = make_mapper(name, config=config)
    for reading in rounds[0][:50]:
        warm.update(reading)
    mapper, costs = make_mapper(name, config=config), []
    for lap in rounds:
        begin = time.process_time()
        for reading in lap:
            mapper.update(reading)
        costs.append((time.process_time() - begin) / len(lap))
    return costs


def memory_by_lap(particles: int, rounds: Sequence[list[Reading]]) -> Memory:
    """Return the memory of `dp-slam` at the end of each lap."""
    mapper = DpSlam(DpSlamConfig(particles=particles))
    memory = Memory(particles, [], [])
    for lap in rounds:
        for reading in lap:
            mapper.update(reading)
        known = mapper.memory
        memory.observations.append(known["observations"])
        memory.ground.append(known["squares"])
    return memory


def draw(
    scans: list[int], costs: dict[str, list[float]], memories: list[Memory], out: Path
) -> None:
    """Draw both diagrams side by side."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    for colour, (line, cost) in zip(SERIES, costs.items(), strict=False):
        left.plot(scans, 1e3 * np.array(cost), color=colour, label=line)
    _label(left, "processor time a scan, ms", "What a scan costs")
    left.set_yscale("log")
    right.plot(scans, memories[-1].ground, color=WALL, lw=2, label="squares seen")
    for k, memory in enumerate(memories):
        right.plot(
            scans, memory.observations, color=SERIES[k], label=f"{memory.particles} particles"
        )
        apart = memory.particles * np.array(memory.ground)
        right.plot(scans, apart, "--", color=SERIES[k], label=f"{memory.particles} maps")
    _label(right, "observations of squares", "What dp-slam remembers")
    right.set_yscale("log")
    save_figure(figure, out)


def _label(axes: Axes, what: str, title: str) -> None:
    axes.set(xlabel="scans", ylabel=what, title=title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
