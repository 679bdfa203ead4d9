"""How often Albot1 confuses two rooms, over many random worlds.

In each world, `random:KIND:SEED`, the robot is guided from room to room. Two kinds of mistakes are
counted; the truth is given by `albot_maps.same_place`:

- *a room taken for another*: two places are merged, but fewer than half of the positions in either
  are the same place as a position in the other;
- *a wrong door*: the robot goes through a known exit, or comes out of one, but fewer than half of
  its next positions are the same place as an earlier position in the believed place.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from jaxtyping import Bool, Int64

from albot_agents.evaluation.plan import parse_seeds
from albot_benchmarks.long_run import patrol
from albot_cli.path_type import PathType
from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from albot_core.files import write_text
from albot_core.geometry.types import Points
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.events import Event, EventKind
from albot_core.mappers.registry import make_mapper
from albot_env.sim.simulator import Simulator
from albot_experiments.albot1_places import new_events
from albot_maps import World, load_world
from albot_maps.same_place import same_places

SAME = 0.5
"""Two places are one if at least this share of one's positions is in the other."""
JUDGED, LEAST = 12, 4
"""Number of positions after a door that are judged, at most up to the next door; and minimum number
at which the door counts, because with fewer the robot has hardly left the doorway."""
MERGED = EventKind.RECOGNIZED, EventKind.FOLLOWED, EventKind.RELOCALISED
CAME_IN = EventKind.ENTERED, EventKind.RETURNED
THROUGH = *CAME_IN, EventKind.NEW, EventKind.LOST


@dataclass(frozen=True, kw_only=True)
class Mistake:
    """A place that was taken for another."""

    seed: int
    """Seed of the world."""
    reading: int
    """The reading after which it happened."""
    event: str
    """The mapper's event, as text."""
    share: float
    """The share of positions that are in both places."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A drive of a mapper with places."""

    points: Points
    """(readings, 2): the robot's true positions (world frame, m)."""
    events: tuple[tuple[Event, ...], ...]
    """The events of the network at each reading."""


def drive(world: World, seed: int, path: float, mapper: str) -> Drive:
    """Guide a robot from room to room for `path` metres.

    Raises:
        InputError: The mapper is not one of Albot1's.
    """
    made = make_mapper(mapper)
    if not isinstance(made, Albot1):
        raise InputError("--mapper", "one of Albot1's", mapper)
    simulator = Simulator(world, movables=False)
    points, events, way, known = [], [], 0.0, made.events
    for reading in patrol(simulator, np.random.default_rng(seed)):
        made.update(reading)
        points.append(simulator.pose[:2])
        events.append(new_events(known, made.events))
        known = made.events
        way += float(np.hypot(*reading.motion[:2]))
        if way >= path:
            break
    return Drive(points=np.array(points), events=tuple(events))


def mistakes(
    driven: Drive, same: Bool[np.ndarray, "readings readings"]
) -> tuple[list[tuple[int, Event, float]], list[tuple[int, Event, float]]]:
    """Find the rooms taken for others, and the wrong doors.

    Args:
        driven: The drive.
        same: Which positions are the same place.

    Returns:
        For each mistake the reading, the event, and the share of positions in both places.
    """
    rooms, doors = [], []
    for k, event, places, current in _followed(driven):
        if event.kind in CAME_IN:
            end = _next_door(driven, k)
            earlier = np.flatnonzero(places == current)
            share = _share(same, np.arange(k, end), earlier)
            if end - k >= LEAST and share < SAME:
                doors.append((k, event, share))
        if event.kind in MERGED:
            share = _overlap(same, places, event)
            if share < SAME:
                rooms.append((k, event, share))
    return rooms, doors


def comparisons(
    driven: Drive, same: Bool[np.ndarray, "readings readings"]
) -> list[tuple[Event, float]]:
    """Find the comparisons of places, each with the share of positions in both places."""
    return [
        (event, _overlap(same, places, event))
        for _, event, places, _ in _followed(driven)
        if event.kind in (EventKind.RECOGNIZED, EventKind.REFUSED)
    ]


def _followed(driven: Drive) -> Iterator[tuple[int, Event, Int64[np.ndarray, "earlier"], int]]:
    """Yield each event with its reading, the earlier readings' places, and the present place."""
    places, current = np.zeros(len(driven.points), np.int64), 0
    for k, events in enumerate(driven.events):
        for event in events:
            if event.kind in THROUGH:
                current = event.place if event.kind == EventKind.RETURNED else event.other
            yield k, event, places[:k], current
            if event.kind in MERGED:
                kept, gone = sorted((event.place, event.other))
                places[places == gone] = kept
                current = kept if current == gone else current
        places[k] = current


def _next_door(driven: Drive, reading: int) -> int:
    """Return the end of the readings that are judged together with a door's reading."""
    end = min(reading + JUDGED, len(driven.points))
    for later in range(reading + 1, end):
        if any(event.kind in THROUGH for event in driven.events[later]):
            return later
    return end


def _overlap(
    same: Bool[np.ndarray, "readings readings"], places: Int64[np.ndarray, "earlier"], event: Event
) -> float:
    """Return the larger share of one place's positions that are in the other place as well."""
    one, other = (np.flatnonzero(places == place) for place in (event.place, event.other))
    if not (len(one) and len(other)):
        return 1.0  # Only the doorway of one of them was seen.
    return max(_share(same, one, other), _share(same, other, one))


def _share(
    same: Bool[np.ndarray, "readings readings"],
    one: Int64[np.ndarray, "ones"],
    other: Int64[np.ndarray, "others"],
) -> float:
    """Return the share of positions in `one` that are the same place as one of `other`."""
    return float(same[np.ix_(one, other)].any(axis=1).mean()) if len(one) else 1.0


def drive_all(
    kind: str, seeds: range, path: float, mapper: str
) -> Iterator[tuple[int, Drive, Bool[np.ndarray, "readings readings"]]]:
    """Yield the drive in each world, with its seed and which positions are the same place."""
    for seed in seeds:
        world = load_world(f"random:{kind}:{seed}")
        driven = drive(world, seed, path, mapper)
        names = [room.name for room in world.rooms]
        at = [world.room_at(*point) for point in driven.points.tolist()]
        numbers = np.array([-1 if name is None else names.index(name) for name in at])
        yield seed, driven, same_places(world, driven.points, numbers)


def measure(kind: str, seeds: range, path: float, mapper: str) -> dict[str, Any]:
    """Drive through all worlds, and count those in which a mistake is made."""
    rooms: list[Mistake] = []
    doors: list[Mistake] = []
    recognized = entered = 0
    for seed, driven, same in drive_all(kind, seeds, path, mapper):
        for made, found in zip((rooms, doors), mistakes(driven, same), strict=True):
            made += [
                Mistake(seed=seed, reading=k, event=str(event), share=round(share, 2))
                for k, event, share in found
            ]
        kinds = [event.kind for events in driven.events for event in events]
        recognized += sum(what in MERGED for what in kinds)
        entered += sum(what in CAME_IN for what in kinds)
    return {
        "mapper": mapper,
        "worlds": f"random:{kind}:{seeds[0]}..{seeds[-1]}",
        "path_m": path,
        "count": len(seeds),
        "worlds_with_a_room_taken_for_another": len({made.seed for made in rooms}),
        "worlds_with_a_wrong_door": len({made.seed for made in doors}),
        "merged": recognized,
        "merged_wrongly": len(rooms),
        "known_doors": entered,
        "wrong_doors": len(doors),
        "mistakes": [asdict(made) for made in (*rooms, *doors)],
    }


@click.command()
@click.option("--kind", default="office", show_default=True, help="Kind of the random worlds.")
@click.option("--seeds", default="5000..5099", show_default=True)
@click.option("--path", default=300.0, show_default=True, help="Length of each drive (m).")
@click.option("--mapper", default="albot1", show_default=True)
@click.option("--json", "out", type=PathType(), help="File for the figures.")
def command(kind: str, seeds: str, path: float, mapper: str, out: Path | None) -> None:
    """Count the random worlds in which a room is taken for another."""
    if not path > 0:
        raise InputError("--path", "above 0", str(path))
    found = measure(kind, parse_seeds(seeds), path, mapper)
    if out is not None:
        write_text(out, json.dumps(found, indent=2) + "\n")
    for made in found["mistakes"]:
        click.echo(f"world {made['seed']}, reading {made['reading']}: {made['event']}")
    low, high = wilson(found["worlds_with_a_room_taken_for_another"], found["count"])
    click.echo(
        f"{mapper}, {found['worlds']}, {path:g} m each: a room is taken for another in "
        f"{found['worlds_with_a_room_taken_for_another']} of {found['count']} worlds "
        f"(95 % interval {low:.1%} to {high:.1%}; {found['merged_wrongly']} of {found['merged']} "
        f"recognitions), a wrong door in {found['worlds_with_a_wrong_door']} "
        f"({found['wrong_doors']} of {found['known_doors']} known doors)"
    )
    if out is not None:
        click.echo(str(out))
