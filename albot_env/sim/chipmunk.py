"""Compiled physics steps of many robots: Chipmunk is called without Python in between.

Compiled code calls Chipmunk's C functions by address (an int64 here). It calls only functions
that take pointers and numbers, because every platform passes those in the same way. Most of
Chipmunk's functions take structures by value, which platforms pass in different ways. So bodies
are read and written between steps with pymunk's batch functions (`pymunk.batch`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import ArbiterFields, BodyFields

from albot_core.geometry.pose_kernels import wrap_angle
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.sim.drive import chord, ramped
from albot_env.sim.odometer import roll_wheels

_CALLS = (
    "cpSpaceStep",
    "cpSpaceEachBody",
    "cpSpaceEachCachedArbiter",
    "pmSpaceBodyGetIteratorFuncBatched",
    "pmSpaceBodySetIteratorFuncBatched",
    "pmSpaceArbiterIteratorFuncBatched",
    "cpBodySetAngularVelocity",
)
STEP, EACH_BODY, EACH_CONTACT, GET_BODY, SET_BODY, GET_CONTACT, SET_TURN_RATE = range(7)
"""Indices into `_CALLS` and `ChipmunkInterface.calls`."""
_VELOCITIES = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
_STATES = BodyFields.POSITION | BodyFields.ANGLE | _VELOCITIES
_CONTACTS = ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID | ArbiterFields.TOTAL_IMPULSE
STATES, VELOCITIES, CONTACTS = range(3)
"""Indices into `ChipmunkInterface.requests`."""


class ChipmunkInterface(NamedTuple):
    """Addresses and buffers with which compiled code drives Chipmunk."""

    calls: np.ndarray
    """(7,) int64: addresses of the functions, indexed by STEP to SET_TURN_RATE."""
    requests: np.ndarray
    """(3,) int64: addresses of pymunk's requests: which fields to read or write, and where."""
    buffer: np.ndarray
    """(6 bodies,) float64: values read from bodies or to be written to them."""
    filled: np.ndarray
    """(1,) int32: number of entries of `buffer` in use, as pymunk counts them."""
    impulses: np.ndarray
    """(2,) int64: pymunk's array of contact impulses: its counter (low half) and the address of
    its values."""
    bodies: np.ndarray
    """(2,) int64: the same for the ids of the two bodies of each contact."""


class RobotArrays(NamedTuple):
    """State arrays of all robots, one row per robot."""

    targets: np.ndarray
    """(n, 2) float64: target wheel speeds left, right (m/s)."""
    wheels: np.ndarray
    """(n, 2) float64: wheel speeds left, right (m/s)."""
    counts: np.ndarray
    """(n,) of ODOMETER_COUNT: counts of the odometers."""
    states: np.ndarray
    """(n, 6) float64: x, y, heading, velocity x, y, turn rate (m, rad, s; world frame), as in
    pymunk's bodies."""
    poses: np.ndarray
    """(n, 3) float64: x, y, heading in [-pi, pi) (m, rad; world frame)."""
    touched: np.ndarray
    """(n, 2) bool: pushed by a wall or obstacle in the last physics step; in any step since it was
    cleared."""
    body_ids: np.ndarray
    """(n,) int64: pymunk's ids of the bodies."""


class SpaceTables(NamedTuple):
    """Assignment of robots to physics spaces."""

    spaces: np.ndarray
    """(spaces, 2) int64: addresses of the space with the robots' bodies, and of the space with the
    massless bodies that move as the wheels would."""
    robot_counts: np.ndarray
    """(spaces,) int64: number of robots in each space."""
    rows: np.ndarray
    """(spaces, MAX_ROBOTS) int64: robots of each space, in pymunk's order of visits."""
    slots: np.ndarray
    """(n,) int64: index of each robot's wheel body in its space."""
    solver_steps: np.ndarray
    """(spaces,) int64: number of Chipmunk's steps in a physics step."""


@KernelDispatcher
@kernel(nogil=True)
def advance(
    chosen: np.ndarray, arguments: KernelArguments, acceleration: float, duration: float, steps: int
) -> None:
    """Run physics steps of `duration` (s) in the chosen spaces.

    In each step the odometers count the wheels' motion, the wheels approach their targets at
    `acceleration` (m/s²), and the bodies move, in one or more of Chipmunk's steps. `arguments`
    holds `ChipmunkInterface`, `SpaceTables`, `RobotArrays`, `OdometerConstants` and the wheel base
    (m).
    """
    chipmunk, tables, robots, errors, base = unpack(arguments)
    gain = acceleration * duration
    for s in chosen:
        space, wheel_space = tables.spaces[s]
        count, rows = tables.robot_counts[s], tables.rows[s]
        solver_steps = tables.solver_steps[s]
        for _ in range(steps):
            for k in range(count):
                robots.touched[rows[k], 0] = False
            # The wheels' new speeds are written before the last of Chipmunk's steps: it computes
            # the velocities with which the bodies move in the whole of the next physics step.
            for _ in range(solver_steps - 1):
                call_with_number(chipmunk.calls[STEP], space, duration / solver_steps)
                _note_pushed_robots(chipmunk, rows, count, robots, space)
            for k in range(count):
                i = rows[k]
                wheels, target = robots.wheels[i], robots.targets[i]
                roll_wheels(robots.counts[i], wheels[0], wheels[1], duration, errors)
                wheels[0], wheels[1] = ramped(wheels[0], wheels[1], target[0], target[1], gain)
                turn_rate = (wheels[1] - wheels[0]) / base
                # pymunk moves a body with its current velocity and then computes the new one, so
                # these wheel speeds move the body in the next physics step.
                heading = robots.states[i, 2] + robots.states[i, 5] * duration
                direction, shortening = chord(heading, turn_rate * duration)
                speed = (wheels[0] + wheels[1]) / 2 * shortening
                at = 3 * tables.slots[i]
                chipmunk.buffer[at] = speed * math.cos(direction)
                chipmunk.buffer[at + 1] = speed * math.sin(direction)
                chipmunk.buffer[at + 2] = turn_rate
            write_velocities(chipmunk, wheel_space)
            call_with_number(chipmunk.calls[STEP], space, duration / solver_steps)
            _note_pushed_robots(chipmunk, rows, count, robots, space)
            read_states(chipmunk, space)
            for k in range(count):
                for column in range(6):
                    robots.states[rows[k], column] = chipmunk.buffer[6 * k + column]
        for k in range(count):
            i = rows[k]
            robots.poses[i, 0], robots.poses[i, 1] = robots.states[i, 0], robots.states[i, 1]
            robots.poses[i, 2] = wrap_angle(robots.states[i, 2])


@kernel()
def _note_pushed_robots(
    chipmunk: ChipmunkInterface, rows: np.ndarray, count: int, robots: RobotArrays, space: int
) -> None:
    """Mark the robots that a wall or obstacle pushed in Chipmunk's last step."""
    calls, contacts = chipmunk.calls, chipmunk.requests[CONTACTS]
    chipmunk.impulses[0] &= ~0xFFFFFFFF
    chipmunk.bodies[0] &= ~0xFFFFFFFF
    call_with_pointers(calls[EACH_CONTACT], space, calls[GET_CONTACT], contacts)
    for k in range((chipmunk.bodies[0] & 0xFFFFFFFF) // 2):
        impulse, pair = chipmunk.impulses[1] + 16 * k, chipmunk.bodies[1] + 16 * k
        # The bits of two floats: a zero has no bit set but its sign.
        if ((load_word(impulse) | load_word(impulse + 8)) << 1) == 0:
            continue
        first, second = load_word(pair), load_word(pair + 8)
        for m in range(count):
            i = rows[m]
            if robots.body_ids[i] == first or robots.body_ids[i] == second:
                robots.touched[i, 0] = robots.touched[i, 1] = True


@kernel()
def read_states(chipmunk: ChipmunkInterface, space: int) -> None:
    """Read x, y, heading, velocity x, y and turn rate of a space's bodies into the buffer."""
    calls = chipmunk.calls
    chipmunk.filled[0] = 0
    call_with_pointers(calls[EACH_BODY], space, calls[GET_BODY], chipmunk.requests[STATES])


@kernel()
def write_velocities(chipmunk: ChipmunkInterface, space: int) -> None:
    """Write velocity x, y and turn rate from the buffer to a space's bodies."""
    calls = chipmunk.calls
    chipmunk.filled[0] = 0
    call_with_pointers(calls[EACH_BODY], space, calls[SET_BODY], chipmunk.requests[VELOCITIES])


def address(pointer: Any) -> int:
    """Return the address in one of pymunk's cffi pointers."""
    return int(ffi.cast("intptr_t", pointer))


class ChipmunkBuffers:
    """Owner of the buffers through which compiled code and pymunk exchange numbers.

    Args:
        bodies: Maximum number of robot and obstacle bodies in a space.
    """

    def __init__(self, bodies: int) -> None:
        # pymunk also reads the body that the walls belong to. It reallocates an array as soon as
        # it is full, which would fail for this one, so it has room to spare.
        buffer = np.zeros(6 * (bodies + 1) + 1)
        floats = ffi.new("pmFloatArray *")
        floats.arr = ffi.from_buffer("cpFloat[]", buffer)
        floats.max = len(buffer)
        # The number of contacts is unbounded; pymunk's own arrays grow.
        impulses = ffi.gc(lib.pmFloatArrayNew(16), lib.pmFloatArrayFree)
        pairs = ffi.gc(lib.pmIntArrayNew(16), lib.pmIntArrayFree)
        requests = [_request(fields, floats, pairs) for fields in (_STATES, _VELOCITIES)]
        requests.append(_request(_CONTACTS, impulses, pairs))
        self._kept = (floats, impulses, pairs, requests)
        calls = [address(ffi.addressof(lib, name)) for name in _CALLS]
        self.interface = ChipmunkInterface(
            calls=np.array(calls, np.int64),
            requests=np.array([address(request) for request in requests], np.int64),
            buffer=buffer,
            filled=np.frombuffer(ffi.buffer(floats), np.int32)[:1],
            impulses=_counter_and_address(impulses),
            bodies=_counter_and_address(pairs),
        )


def _request(fields: Any, floats: Any, integers: Any) -> Any:
    request = ffi.new("pmBatchedData *")
    request.fields = fields.value
    request.floatArray = floats
    request.intArray = integers
    return request


def _counter_and_address(array: Any) -> np.ndarray:
    """View one of pymunk's arrays as two int64: its counter in the low half, and its address."""
    return np.frombuffer(ffi.buffer(array, 16), np.int64)


def _call_with_pointers(typing: Any, function: Any, first: Any, second: Any, third: Any) -> Any:
    """Call the function at an address with three pointers."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word, word])
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, types.int64), generate


def _call_with_number(typing: Any, function: Any, pointer: Any, number: Any) -> Any:
    """Call the function at an address with a pointer and a number."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(64), ir.DoubleType()])
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.float64), generate


def _load_word(typing: Any, address: Any) -> Any:
    """Load the 64 bits at an address."""

    def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return builder.load(builder.inttoptr(values[0], ir.IntType(64).as_pointer()))

    return types.int64(types.int64), generate


call_with_pointers: Any = intrinsic(_call_with_pointers)
call_with_number: Any = intrinsic(_call_with_number)
load_word: Any = intrinsic(_load_word)
