"""Movable things around the robots of a fleet: doors, boxes and people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pymunk
from jaxtyping import Bool, Float64, Int64

from albot_core.geometry.types import Pose, Poses, Segments
from albot_env.sim.chipmunk_kernels import Engine
from albot_env.sim.engine import address
from albot_env.sim.space import Floor
from albot_env.sim.thing_arrays import Stage
from albot_env.sim.thing_bodies import Parts, box_parts, door_parts, walker_parts
from albot_env.sim.thing_kernels import begin, command, observe, outline
from albot_env.sim.thing_layout import Layout
from albot_maps.world import World


class Still(NamedTuple):
    """Where the things around a robot are, and how they move."""

    tables: dict[str, np.ndarray]
    """Their records by kind: none where nothing moves."""
    bodies: Float64[np.ndarray, "bodies 6"]
    """x, y, heading, velocity x, y, turn rate of their bodies (m, rad, s; world frame)."""


_PLACES = ("row", "body", "first")
"""Fields of records that say where something is kept, which differs from floor to floor."""


class Things:
    """What moves around each robot of a fleet, on a floor that is the robot's own.

    Where they are is a function of the key with which they began, of the world, and of
    what the robot has done since, to the last bit. Use it so: when a robot is put
    somewhere, `leave` before and `begin` after; around physics steps, `command` before and
    `observe` after.

    Args:
        robots: How many robots there are.
        radius: Radius of the robots (m).
    """

    def __init__(self, robots: int, radius: float) -> None:
        self._radius = radius
        self._layout = Layout(robots)
        self._floors: list[Floor | None] = [None] * robots
        self._parts: list[Parts] = [[] for _ in range(robots)]
        self._legs: list[list[pymunk.Body]] = [[] for _ in range(robots)]
        self._shelves: list[pymunk.Space | None] = [None] * robots
        self.present: Bool[np.ndarray, "robots"] = np.zeros(robots, np.bool_)
        """Around which robots anything moves."""
        self.most_bodies = 0
        """How many bodies one floor has had of things, at most."""

    @property
    def stage(self) -> Stage:
        """All tables; others after each `begin`."""
        return self._layout.stage

    def segments(self, row: int) -> Segments:
        """Outlines of a robot's things where they are now: what rays meet."""
        own = self.stage.robots[row]
        return self.stage.segments[own["segments"] : own["segments_end"]].copy()

    def doors(self, row: int) -> Float64[np.ndarray, "doors"]:
        """The directions of a robot's doors as seen from their hinges (rad)."""
        return self._columns(row, "doors", "angle")[:, 0]

    def boxes(self, row: int) -> Poses:
        """Where a robot's boxes are: x, y, heading."""
        return self._columns(row, "boxes", "x", "y", "heading")

    def walkers(self, row: int) -> Float64[np.ndarray, "walkers 4"]:
        """Where a robot's walkers are and go: x, y, velocity x, y."""
        return self._columns(row, "walkers", "x", "y", "vx", "vy")

    def _columns(self, row: int, kind: str, *names: str) -> Float64[np.ndarray, "things columns"]:
        table = self._own(row, kind)
        return np.stack([table[name] for name in names], axis=1)

    def _own(self, row: int, kind: str) -> np.ndarray:
        """A robot's rows of a table."""
        own = self.stage.robots[row]
        table: np.ndarray = getattr(self.stage, kind)
        return table[own[kind] : own[f"{kind}_end"]]

    def leave(self, row: int) -> None:
        """Take a robot's things off its floor."""
        floor = self._floors[row]
        if floor is None:
            return
        floor.space.remove(*self._parts[row])
        self._parts[row] = []
        self._floors[row] = None
        self._layout.fill(row, None)
        self.present[row] = False

    def begin(self, row: int, world: World, floor: Floor, pose: Pose, key: int) -> None:
        """Put the things of a world where they begin; the robot's last ones have left.

        Their bodies are made anew: what comes next must not depend on what was before.

        Args:
            row: The robot.
            world: The world that it is in; something moves there.
            floor: Its floor, with this robot alone on it.
            pose: Where it begins, in the world frame.
            key: 64 bits, of which all their random numbers are a function from now on.
        """
        self._floors[row] = floor
        self._layout.fill(row, world)
        self._reserve_legs(row, len(world.movables.walkers))
        own = self.stage.robots[row : row + 1]
        own["space"], own["shelf"] = floor.addresses[0], address(self._shelf(row)._space)
        state = np.array([*pose, 0.0, 0.0, 0.0])
        begin(self.stage, row, np.uint64(key), state, self._radius)
        bodies = self._build(row, world, floor)
        floor.space.add(*self._parts[row])
        self._enlist(row, floor, [body.id for body in bodies])
        self.present[row] = True
        self.most_bodies = max(self.most_bodies, len(bodies))

    def halt(self, row: int) -> Still:
        """Where a robot's things are now (copies)."""
        tables = {kind: self._own(row, kind).copy() for kind in ("doors", "boxes", "walkers")}
        states = [
            (*body.position, body.angle, *body.velocity, body.angular_velocity)
            for body in self._bodies(row)
        ]
        return Still(tables, np.array(states, np.float64).reshape(-1, 6))

    def resume(self, row: int, still: Still) -> None:
        """Put a robot's things, which have begun, where those of another one were."""
        for kind, table in still.tables.items():
            own = self._own(row, kind)
            for name in set(own.dtype.names or ()) - set(_PLACES):
                own[name] = table[name]
        for body, state in zip(self._bodies(row), still.bodies.tolist(), strict=True):
            body.position, body.angle = state[:2], state[2]
            body.velocity, body.angular_velocity = state[3:5], state[5]
        floor = self._floors[row]
        if floor is not None:
            outline(self.stage, row)
            for body in self._bodies(row):
                floor.space.reindex_shapes_for_body(body)

    def _bodies(self, row: int) -> list[pymunk.Body]:
        """The bodies of a robot's things, doors first, walkers last."""
        return [part for part in self._parts[row] if isinstance(part, pymunk.Body)]

    def command(
        self,
        rows: Int64[np.ndarray, "some"],
        engine: Engine,
        states: Float64[np.ndarray, "robots 6"],
        duration: float,
    ) -> None:
        """Let doors and walkers decide what they do in the next while (s).

        Args:
            rows: Robots around which something moves.
            engine: With room for the bodies of a floor.
            states: All robots': x, y, heading, velocity x, y, turn rate (world frame).
            duration: Until the next command (s).
        """
        command(rows, engine, self.stage, states, self._radius, duration)

    def observe(self, rows: Int64[np.ndarray, "some"], engine: Engine) -> None:
        """Read where the things of some robots are."""
        observe(rows, engine, self.stage)

    def _shelf(self, row: int) -> pymunk.Space:
        """The space of a robot's walkers' legs, in which no time passes."""
        shelf = self._shelves[row]
        if shelf is None:
            shelf = self._shelves[row] = pymunk.Space()
        return shelf

    def _reserve_legs(self, row: int, number: int) -> None:
        """Have legs for so many walkers; those of none move nobody."""
        legs = self._legs[row]
        while len(legs) < number:
            legs.append(pymunk.Body(body_type=pymunk.Body.KINEMATIC))
            self._shelf(row).add(legs[-1])
        for body in legs:
            body.velocity = 0.0, 0.0

    def _build(self, row: int, world: World, floor: Floor) -> list[pymunk.Body]:
        """Make the bodies of doors, boxes and walkers."""
        doors, walkers = self._own(row, "doors"), self._own(row, "walkers")
        made = [
            door_parts(door, float(record["angle"]))
            for door, record in zip(world.movables.doors, doors, strict=True)
        ]
        doors["body"] = [address(body._body) for body, _ in made]
        ground = floor.space.static_body
        made += [box_parts(box, ground) for box in world.movables.boxes]
        made += [
            walker_parts(walker, (float(record["x"]), float(record["y"])), legs)
            for walker, record, legs in zip(
                world.movables.walkers, walkers, self._legs[row], strict=False
            )
        ]
        self._parts[row] = [part for _, parts in made for part in parts]
        return [body for body, _ in made]

    def _enlist(self, row: int, floor: Floor, ids: Sequence[int]) -> None:
        """Note in which places pymunk reads out the bodies of doors, boxes and walkers."""
        order = {id_: place for place, id_ in enumerate(floor.body_ids)}
        places = [order[id_] for id_ in ids]
        for kind in ("doors", "boxes", "walkers"):
            table = self._own(row, kind)
            table["row"] = places[: len(table)]
            places = places[len(table) :]
