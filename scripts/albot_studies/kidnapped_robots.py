"""Shares of kidnapped robots that notice the kidnapping, and that find out where they are.

In each world the robot is guided from room to room. After 120 to 259 readings it is moved to
another room, with another heading, while its odometer reports no motion. Then it is guided on for
60 readings, or as many as requested. The robots are counted that

- give a *false alarm*: they believe to be lost before they are moved;
- *notice*: they believe to be lost at one of the next three readings;
- find out where they are, *rightly* or *wrongly*: at the end they no longer believe to be lost,
  and their position is right to 2 m, or is not.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_agents.evaluation.plan import parse_seeds
from albot_benchmarks.long_run import patrol
from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.evaluation.intervals import wilson
from albot_core.files import write_text
from albot_core.geometry.poses import relative
from albot_core.geometry.types import Pose
from albot_core.mappers.registry import make_mapper
from albot_core.sensing.reading import Reading
from albot_env.sim.simulator import Simulator
from albot_env.tasks.place_recognition.tours import StoppingRooms
from albot_maps import World, load_world

BEFORE, AFTER = (120, 260), 60
"""Number of readings before the robot is moved (drawn from the first to below the second value),
and number of readings after."""
SOON = 3
"""The robot has noticed if it believes to be lost at one of this many readings after the move."""
RIGHT = 2.0
"""A believed position is right up to this error (m); the map has drifted by less."""


@dataclass(frozen=True, kw_only=True)
class Kidnapping:
    """The outcome of a kidnapping."""

    seed: int
    """Seed of the world."""
    reading: int
    """The first reading at the new position."""
    false_alarm: bool
    """Whether the robot believed to be lost before."""
    noticed: bool
    """Whether the robot noticed."""
    lost: bool
    """Whether the robot believes to be lost at the end."""
    error: float
    """Error of the robot's position at the end (m)."""

    @property
    def found(self) -> bool:
        """Whether the robot noticed, and knows its position at the end."""
        return self.noticed and not self.lost and self.error <= RIGHT

    @property
    def mistaken(self) -> bool:
        """Whether the robot noticed, and believes in a wrong position at the end."""
        return self.noticed and not self.lost and self.error > RIGHT


def kidnap(world: World, seed: int, mapper: str, after: int = AFTER) -> Kidnapping:
    """Guide a robot through a world, move it, and guide it on for `after` readings.

    Raises:
        InputError: The mapper is unknown, or the world has fewer than two rooms to stop in.
    """
    made, rng = make_mapper(mapper), np.random.default_rng(seed)
    count, simulator = int(rng.integers(*BEFORE)), Simulator(world, movables=False)
    lost = []
    for reading in moved_after(count, simulator, rng, after):
        made.update(reading)
        lost.append(not made.estimate.localised)
    believed = relative(made.estimate.home, made.estimate.pose)
    true = relative(world.starts[0], simulator.pose)
    return Kidnapping(
        seed=seed,
        reading=count,
        false_alarm=any(lost[:count]),
        noticed=any(lost[count : count + SOON]),
        lost=lost[-1],
        error=round(float(np.hypot(*(believed - true)[:2])), 2),
    )


def moved_after(
    count: int, simulator: Simulator, rng: np.random.Generator, after: int
) -> Iterator[Reading]:
    """Yield `count` readings, move the robot, and yield `after` more."""
    yield from islice(patrol(simulator, rng), count)
    yield from islice(patrol(simulator, rng, _elsewhere(simulator, rng)), after)


def _elsewhere(simulator: Simulator, rng: np.random.Generator) -> Pose:
    """Return a pose in another room than the robot's (world frame)."""
    world, stops = simulator.world, StoppingRooms(simulator.world)
    here = world.room_at(*simulator.pose[:2].tolist())
    room = rng.choice([room for room in stops.rooms if world.rooms[room].name != here])
    return np.array((*stops.point(int(room), rng), rng.uniform(-np.pi, np.pi)))


def measure(worlds: str, seeds: range, mapper: str, after: int = AFTER) -> dict[str, Any]:
    """Kidnap a robot in each world; return the counts."""
    done = [
        kidnap(load_world(worlds.replace("SEED", str(seed))), seed, mapper, after) for seed in seeds
    ]
    counts = {
        name: sum(getattr(one, name) for one in done)
        for name in ("false_alarm", "noticed", "found", "mistaken")
    }
    figures = {
        "mapper": mapper,
        "worlds": worlds,
        "seeds": f"{seeds[0]}..{seeds[-1]}",
        "readings_after": after,
    }
    return {**figures, "count": len(done), **counts, "runs": [asdict(one) for one in done]}


@click.command()
@click.option(
    "--worlds",
    default="random:office:SEED?rooms=8",
    show_default=True,
    help="The worlds; SEED stands for each seed.",
)
@click.option("--seeds", default="7100..7159", show_default=True)
@click.option("--mapper", default="albot1", show_default=True)
@click.option(
    "--after",
    default=AFTER,
    show_default=True,
    type=CountType(SOON),
    help="Readings after the robot was moved.",
)
@click.option("--json", "out", type=PathType(), help="File for the figures.")
def command(worlds: str, seeds: str, mapper: str, after: int, out: Path | None) -> None:
    """Count the kidnapped robots that notice it, and those that find out where they are."""
    found = measure(worlds, parse_seeds(seeds), mapper, after)
    if out is not None:
        write_text(out, json.dumps(found, indent=2) + "\n")
    low, high = wilson(found["noticed"], found["count"])
    click.echo(
        f"{mapper}, {worlds}, seeds {found['seeds']}: {found['noticed']} of {found['count']} "
        f"robots notice (95 % interval {low:.0%} to {high:.0%}); in the end {found['found']} of "
        f"them know where they are, {found['mistaken']} are mistaken, the others know that they "
        f"are lost; {found['false_alarm']} false alarms before"
    )
    if out is not None:
        click.echo(str(out))
