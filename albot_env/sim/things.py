"""Movable things around the robots of a fleet: doors, boxes and people."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import pymunk
from jaxtyping import Float64, Int64

from albot_core.geometry.types import Poses, Segments
from albot_env.sim.chipmunk_kernels import Engine
from albot_env.sim.space import Floor
from albot_env.sim.thing_bodies import Parts, box_parts, door_parts, walker_parts
from albot_env.sim.thing_kernels import begin, command, observe
from albot_env.sim.thing_layout import lay_out
from albot_maps.world import World


class Things:
    """What moves around each robot of a fleet, on a floor that is the robot's own.

    Where they are is a function of the key with which they began, of the world, and of
    what the robot has done since, to the last bit. Use it so: when a robot is put
    somewhere, `leave` before and `begin` after; around physics steps, `command` before and
    `observe` after.

    Args:
        worlds: The world of each robot; those of worlds in which nothing moves cost nothing.
        floors: The floor of each, with that robot alone on it.
        radius: Radius of the robots (m).
    """

    def __init__(self, worlds: Sequence[World], floors: Sequence[Floor], radius: float) -> None:
        self._movables = [world.movables for world in worlds]
        self._floors = floors
        self._radius = radius
        self._legs = [
            [pymunk.Body(body_type=pymunk.Body.KINEMATIC) for _ in movables.walkers]
            for movables in self._movables
        ]
        self._shelves = [pymunk.Space() for _ in worlds]
        for shelf, legs in zip(self._shelves, self._legs, strict=True):
            shelf.add(*legs)
        self._parts: list[Parts] = [[] for _ in worlds]
        self._leaves: list[pymunk.Body] = [
            pymunk.Body(body_type=pymunk.Body.KINEMATIC)
            for movables in self._movables
            for _ in movables.doors
        ]
        self._stage = lay_out(worlds, floors, self._shelves)
        self._rates = np.zeros(len(self._leaves))

    @property
    def most_bodies(self) -> int:
        """How many bodies things have on one floor, at most."""
        return max(len(m.doors) + len(m.boxes) + len(m.walkers) for m in self._movables)

    @property
    def segments(self) -> Segments:
        """Outlines of all things where they are now: what rays meet. The array stays."""
        return self._stage.segments

    @cached_property
    def segments_at(self) -> Int64[np.ndarray, "fences"]:
        """Where in `segments` each robot's begin, and after the last where they end."""
        ends: np.ndarray = self._stage.robots["segments_end"]
        return np.concatenate(([0], ends))

    @property
    def boxes(self) -> Poses:
        """Where all boxes are: x, y, heading."""
        boxes = self._stage.boxes
        return np.stack((boxes["x"], boxes["y"], boxes["heading"]), axis=1)

    @property
    def walkers(self) -> Float64[np.ndarray, "walkers 4"]:
        """Where all walkers are and go: x, y, velocity x, y."""
        walkers = self._stage.walkers
        return np.stack([walkers[name] for name in ("x", "y", "vx", "vy")], axis=1)

    @property
    def doors(self) -> Float64[np.ndarray, "doors"]:
        """The directions of all leaves as seen from their hinges (rad)."""
        angles: np.ndarray = self._stage.doors["angle"].copy()
        return angles

    def leave(self, row: int) -> None:
        """Take a robot's things off its floor."""
        self._floors[row].space.remove(*self._parts[row])
        self._parts[row] = []

    def begin(self, row: int, pose: Float64[np.ndarray, "3"], key: int) -> None:
        """Put a robot's things where they begin; before it they have left the floor.

        Their bodies are made anew: what comes next must not depend on what was before.

        Args:
            row: The robot.
            pose: Where it begins, in the world frame.
            key: 64 bits, of which all their random numbers are a function from now on.
        """
        if not self._movables[row]:
            return
        self._put_boxes(row)
        state = np.array([*pose, 0.0, 0.0, 0.0])
        begin(self._stage, row, np.uint64(key), state, self._radius)
        bodies = [*self._hang(row), *self._drop(row), *self._set_off(row)]
        self._floors[row].space.add(*self._parts[row])
        self._enlist(row, [body.id for body in bodies])

    def command(
        self, engine: Engine, states: Float64[np.ndarray, "robots 6"], duration: float
    ) -> None:
        """Let doors and walkers decide what they do in the next while (s).

        Args:
            engine: With room for the bodies of a floor.
            states: The robots': x, y, heading, velocity x, y, turn rate (world frame).
            duration: Until the next command (s).
        """
        command(engine, self._stage, states, self._radius, duration)
        rates = self._stage.doors["rate"]
        for d in np.flatnonzero(rates != self._rates):
            self._leaves[d].angular_velocity = float(rates[d])
        self._rates[:] = rates

    def observe(self, engine: Engine) -> None:
        """Read where all things are, into `segments` and the rest."""
        observe(engine, self._stage)

    def _put_boxes(self, row: int) -> None:
        """Note where the boxes begin."""
        first = self._stage.robots[row]["boxes"]
        for b, box in enumerate(self._movables[row].boxes, first):
            record = self._stage.boxes[b]
            (record["x"], record["y"]), record["heading"] = box.at, box.heading

    def _hang(self, row: int) -> list[pymunk.Body]:
        """The bodies of the doors."""
        bodies = []
        for d, door in enumerate(self._movables[row].doors, self._stage.robots[row]["doors"]):
            body, parts = door_parts(door, float(self._stage.doors[d]["angle"]))
            self._leaves[d] = body
            self._rates[d] = 0.0
            self._parts[row] += parts
            bodies.append(body)
        return bodies

    def _drop(self, row: int) -> list[pymunk.Body]:
        """The bodies of the boxes."""
        bodies = []
        ground = self._floors[row].space.static_body
        for box in self._movables[row].boxes:
            body, parts = box_parts(box, ground)
            self._parts[row] += parts
            bodies.append(body)
        return bodies

    def _set_off(self, row: int) -> list[pymunk.Body]:
        """The bodies of the walkers."""
        bodies = []
        first = self._stage.robots[row]["walkers"]
        for k, (walker, legs) in enumerate(
            zip(self._movables[row].walkers, self._legs[row], strict=True)
        ):
            legs.velocity = 0.0, 0.0
            record = self._stage.walkers[first + k]
            body, parts = walker_parts(walker, (float(record["x"]), float(record["y"])), legs)
            self._parts[row] += parts
            bodies.append(body)
        return bodies

    def _enlist(self, row: int, ids: Sequence[int]) -> None:
        """Note in which places pymunk reads out the bodies of doors, boxes and walkers."""
        order = {id_: place for place, id_ in enumerate(self._floors[row].body_ids)}
        places = [order[id_] for id_ in ids]
        own = self._stage.robots[row]
        for kind in ("doors", "boxes", "walkers"):
            first, end = own[kind], own[f"{kind}_end"]
            getattr(self._stage, kind)["row"][first:end] = places[: end - first]
            places = places[end - first :]
