"""What must hold of the movable things in a world."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely

from albot_core.geometry.types import Points, Segments
from albot_maps.freespace import FreeSpace, wall_lines
from albot_maps.movables import Movables, Walker

TOLERANCE = 0.01
"""How deep (m) the leaf of a door may reach into a wall or another's way; and how far a box
stands from all else."""
_WAY_OUT = 1.0
"""How far (m) a robot gets from a start before it must push a box."""


class Fault(NamedTuple):
    """What is wrong with a thing."""

    place: str
    """As `movables.doors[0]`."""
    expected: str
    found: str


class Surroundings(NamedTuple):
    """What the things stand among."""

    walls: Segments
    starts: Points
    """Where robots begin (m)."""
    radius: float
    """Theirs (m)."""

    @property
    def extent(self) -> shapely.Polygon:
        """The rectangle around the walls."""
        return shapely.box(*wall_lines(self.walls).bounds)


def faults(movables: Movables, around: Surroundings) -> Iterator[Fault]:
    """What is wrong with the things of a world, in the order of doors, boxes and walkers."""
    lines = wall_lines(around.walls)
    shapely.prepare(lines)
    yield from _door_faults(movables, around, lines)
    yield from _box_faults(movables, around, lines)
    for index, walker in enumerate(movables.walkers):
        for expected, found in _walker_faults(walker, movables, around, lines):
            yield Fault(f"movables.walkers[{index}]", expected, found)
    yield from _walled_in(movables, around)


def _door_faults(
    movables: Movables, around: Surroundings, lines: shapely.Geometry
) -> Iterator[Fault]:
    sweeps: list[shapely.Polygon] = []
    starts = shapely.points(around.starts)
    for index, door in enumerate(movables.doors):
        place, sweep = f"movables.doors[{index}]", door.sweep
        inner = sweep.buffer(-TOLERANCE)
        if not around.extent.buffer(TOLERANCE).contains(sweep):
            yield Fault(place, "a door inside the building", f"a hinge at {door.hinge}")
        if lines.intersects(inner):
            yield Fault(place, "a leaf that swings clear of the walls", "one that a wall bars")
        for other, sweep_before in enumerate(sweeps):
            if inner.intersects(sweep_before):
                expected = "a leaf that swings clear of the other doors'"
                yield Fault(place, expected, f"one that meets doors[{other}]")
        if shapely.distance(starts, sweep).min() < around.radius:
            expected = f"a leaf that stays {around.radius} m clear of the starts"
            yield Fault(place, expected, f"one at {shapely.distance(starts, sweep).min():.3g} m")
        sweeps.append(inner)


def _box_faults(
    movables: Movables, around: Surroundings, lines: shapely.Geometry
) -> Iterator[Fault]:
    starts = shapely.points(around.starts)
    outlines = [box.outline for box in movables.boxes]
    for index, outline in enumerate(outlines):
        place = f"movables.boxes[{index}]"
        if not around.extent.contains(outline):
            yield Fault(place, "a box inside the building", f"one at {movables.boxes[index].at}")
        distances = {"a wall": outline.distance(lines)}
        distances |= {f"boxes[{k}]": outline.distance(outlines[k]) for k in range(index)}
        distances |= {
            f"what doors[{k}] sweeps": outline.distance(door.sweep)
            for k, door in enumerate(movables.doors)
        }
        for what, distance in distances.items():
            if distance < TOLERANCE:
                found = f"{what} at {distance:.3g} m"
                yield Fault(place, f"a box {TOLERANCE} m clear of all else", found)
        nearest = float(shapely.distance(starts, outline).min())
        if nearest < around.radius:
            expected = f"a box {around.radius} m clear of the starts"
            yield Fault(place, expected, f"one at {nearest:.3g} m")


def _walker_faults(
    walker: Walker, movables: Movables, around: Surroundings, lines: shapely.Geometry
) -> Iterator[tuple[str, str]]:
    legs = shapely.linestrings(walker.legs.reshape(-1, 2, 2))
    if not around.extent.contains(shapely.union_all(legs)):
        yield "a route inside the building", "one that leaves it"
    obstacles = [lines, *(box.outline for box in movables.boxes)]
    clearance = min(float(shapely.distance(legs, obstacle).min()) for obstacle in obstacles)
    if clearance < walker.radius:
        expected = f"a route {walker.radius:g} m clear of walls and boxes"
        yield expected, f"one at {clearance:.3g} m"
    # Wherever the robot begins, some waypoint is then free.
    points = np.array(walker.route)
    spread = float(np.hypot(*(points[:, np.newaxis] - points).T).max())
    least = 2 * (around.radius + walker.radius + TOLERANCE)
    if spread < least:
        yield f"waypoints {least:g} m apart", f"at most {spread:.3g} m"


def _walled_in(movables: Movables, around: Surroundings) -> Iterator[Fault]:
    """The starts from which a robot gets nowhere unless it pushes a box."""
    outlines = shapely.union_all([box.outline for box in movables.boxes])
    for index, start in enumerate(around.starts):
        # An empty shape is at no distance (nan).
        if not shapely.Point(start).distance(outlines) < _WAY_OUT + around.radius:
            continue
        sides = [_sides(box.corners) for box in movables.boxes]
        bare = FreeSpace(around.walls, around.radius)
        full = FreeSpace(np.concatenate((around.walls, *sides)), around.radius)
        if _reach(full, start) < min(_WAY_OUT, _reach(bare, start)):
            expected = "a way out between the boxes"
            yield Fault(f"starts[{index}]", expected, "boxes all round")


def _sides(corners: Points) -> Segments:
    return np.concatenate((corners, np.roll(corners, -1, axis=0)), axis=1)


def _reach(space: FreeSpace, start: np.ndarray) -> float:
    """How far from a start the disc gets (m)."""
    here = shapely.Point(start)
    return float(shapely.hausdorff_distance(space.region_at(start).exterior, here))
