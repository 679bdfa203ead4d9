"""The physics of many robots, step by step, without Python in between.

Between two steps bodies are read and written as pymunk does it in batches (`pymunk.batch`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from albot_core.geometry.directions import wrapped
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.sim.chipmunk_calls import load, take_step, visit
from albot_env.sim.drive_kernels import chord, ramped
from albot_env.sim.odometer_kernels import roll

STEP, EACH_BODY, EACH_CONTACT, GET_BODY, SET_BODY, GET_CONTACT, SET_SPIN = range(7)
"""Places in `Engine.calls`."""
STATES, PUSHES, CONTACTS = range(3)
"""Places in `Engine.requests`."""


class Engine(NamedTuple):
    """Addresses and buffers with which the kernel drives Chipmunk."""

    calls: np.ndarray
    """(7,) int64: addresses of functions (see STEP and so on)."""
    requests: np.ndarray
    """(3,) int64: addresses of pymunk's structures that say what is read or written where."""
    buffer: np.ndarray
    """(6 bodies,) float64: what is read of bodies or written to them."""
    filled: np.ndarray
    """(1,) int32: how much of the buffer is in use, as pymunk counts it."""
    impulses: np.ndarray
    """(2,) int64: pymunk's array of the contacts' impulses: its counter (in the low half) and
    the address of its numbers."""
    bodies: np.ndarray
    """(2,) int64: the same of the ids of the two bodies of each contact."""


class Robots(NamedTuple):
    """The arrays of all robots; a row each."""

    targets: np.ndarray
    """(n, 2) float64: wheel speeds left, right to be reached (m/s)."""
    wheels: np.ndarray
    """(n, 2) float64: wheel speeds left, right (m/s)."""
    counts: np.ndarray
    """(n, COUNTS) float64: what the odometers have counted (see `odometer_kernels`)."""
    states: np.ndarray
    """(n, 6) float64: x, y, heading, velocity x, y, turn rate (m, rad, s; world frame): what pymunk
    knows of the bodies."""
    poses: np.ndarray
    """(n, 3) float64: x, y, heading, which is in [-pi, pi)."""
    touched: np.ndarray
    """(n, 2) bool: pushed back by a wall in the last physics step; in any since cleared."""
    ids: np.ndarray
    """(n,) int64: pymunk's ids of the bodies."""


class Floors(NamedTuple):
    """Which robots drive on which floor."""

    spaces: np.ndarray
    """(floors, 2) int64: addresses of the space with the robots' bodies, and of the one that
    holds the bodies that move as their wheels would."""
    crews: np.ndarray
    """(floors,) int64: how many robots are on each."""
    members: np.ndarray
    """(floors, crowd) int64: their rows, in the order in which pymunk visits them."""
    places: np.ndarray
    """(n,) int64: for each robot, which of its floor's wheels are its own."""


@KernelDispatcher
@kernel(nogil=True)
def advance(
    chosen: np.ndarray, arguments: KernelArguments, acceleration: float, duration: float, steps: int
) -> None:
    """Let some physics steps (s) pass on the floors chosen.

    In each the odometers count what the wheels roll, the wheels approach their targets at
    an acceleration (m/s²), and the bodies move. `arguments` holds `Engine`, `Floors`, `Robots`,
    the odometer's constants and the wheel base (m).
    """
    engine, floors, robots, errors, base = unpack(arguments)
    gain = acceleration * duration
    for f in chosen:
        space, shelf = floors.spaces[f]
        crew, members = floors.crews[f], floors.members[f]
        for _ in range(steps):
            for k in range(crew):
                i = members[k]
                wheels, target = robots.wheels[i], robots.targets[i]
                roll(robots.counts[i], wheels[0], wheels[1], duration, errors)
                wheels[0], wheels[1] = ramped(wheels[0], wheels[1], target[0], target[1], gain)
                turn_rate = (wheels[1] - wheels[0]) / base
                # pymunk moves a body with the velocity that it has and then finds the new
                # one, so these wheels move it in the physics step after.
                heading = robots.states[i, 2] + robots.states[i, 5] * duration
                direction, shortening = chord(heading, turn_rate * duration)
                speed = (wheels[0] + wheels[1]) / 2 * shortening
                place = 3 * floors.places[i]
                engine.buffer[place] = speed * math.cos(direction)
                engine.buffer[place + 1] = speed * math.sin(direction)
                engine.buffer[place + 2] = turn_rate
                robots.touched[i, 0] = False
            engine.filled[0] = 0
            visit(engine.calls[EACH_BODY], shelf, engine.calls[SET_BODY], engine.requests[PUSHES])
            take_step(engine.calls[STEP], space, duration)
            _note_pushes(engine, members, crew, robots, space)
            engine.filled[0] = 0
            visit(engine.calls[EACH_BODY], space, engine.calls[GET_BODY], engine.requests[STATES])
            for k in range(crew):
                for column in range(6):
                    robots.states[members[k], column] = engine.buffer[6 * k + column]
        for k in range(crew):
            i = members[k]
            robots.poses[i, 0], robots.poses[i, 1] = robots.states[i, 0], robots.states[i, 1]
            robots.poses[i, 2] = wrapped(robots.states[i, 2])


@kernel()
def _note_pushes(
    engine: Engine, members: np.ndarray, crew: int, robots: Robots, space: int
) -> None:
    """Note which robots a wall pushed back in the last physics step."""
    engine.impulses[0] &= ~0xFFFFFFFF
    engine.bodies[0] &= ~0xFFFFFFFF
    visit(engine.calls[EACH_CONTACT], space, engine.calls[GET_CONTACT], engine.requests[CONTACTS])
    for k in range((engine.bodies[0] & 0xFFFFFFFF) // 2):
        impulse, pair = engine.impulses[1] + 16 * k, engine.bodies[1] + 16 * k
        # The bits of two numbers; but for the sign, a zero has none.
        if ((load(impulse) | load(impulse + 8)) << 1) == 0:
            continue
        first, second = load(pair), load(pair + 8)
        for m in range(crew):
            i = members[m]
            if robots.ids[i] == first or robots.ids[i] == second:
                robots.touched[i, 0] = robots.touched[i, 1] = True
