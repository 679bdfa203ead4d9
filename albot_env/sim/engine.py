"""What the compiled physics needs of pymunk: the addresses of functions, and buffers."""

from __future__ import annotations

from typing import Any

import numpy as np
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import ArbiterFields, BodyFields

from albot_env.sim.chipmunk_kernels import Engine

_CALLS = (
    "cpSpaceStep",
    "cpSpaceEachBody",
    "cpSpaceEachCachedArbiter",
    "pmSpaceBodyGetIteratorFuncBatched",
    "pmSpaceBodySetIteratorFuncBatched",
    "pmSpaceArbiterIteratorFuncBatched",
    "cpBodySetAngularVelocity",
)
_VELOCITIES = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
_STATES = BodyFields.POSITION | BodyFields.ANGLE | _VELOCITIES
_CONTACTS = ArbiterFields.BODY_A_ID | ArbiterFields.BODY_B_ID | ArbiterFields.TOTAL_IMPULSE


def address(pointer: Any) -> int:
    """The address in one of pymunk's cffi pointers."""
    return int(ffi.cast("intptr_t", pointer))


class Bridge:
    """Owns the buffers through which compiled code and pymunk exchange numbers.

    Args:
        bodies: Most robots and things on a floor.
    """

    def __init__(self, bodies: int) -> None:
        # pymunk also reads the body that the walls belong to, and it asks the system for a
        # larger array, which this is none of, as soon as one is full: let it never be.
        buffer = np.zeros(6 * (bodies + 1) + 1)
        floats = ffi.new("pmFloatArray *")
        floats.arr = ffi.from_buffer("cpFloat[]", buffer)
        floats.max = len(buffer)
        # There is no telling how many walls robots touch: pymunk's own arrays grow.
        impulses = ffi.gc(lib.pmFloatArrayNew(16), lib.pmFloatArrayFree)
        pairs = ffi.gc(lib.pmIntArrayNew(16), lib.pmIntArrayFree)
        requests = [_request(fields, floats, pairs) for fields in (_STATES, _VELOCITIES)]
        requests.append(_request(_CONTACTS, impulses, pairs))
        self._kept = (floats, impulses, pairs, requests)
        self._arrays = [_words(impulses), _words(pairs)]
        calls = [address(ffi.addressof(lib, name)) for name in _CALLS]
        self.engine = Engine(
            calls=np.array(calls, np.int64),
            requests=np.array([address(request) for request in requests], np.int64),
            buffer=buffer,
            filled=np.frombuffer(ffi.buffer(floats), np.int32)[:1],
            impulses=_words(impulses),
            bodies=_words(pairs),
        )


def _request(fields: Any, floats: Any, integers: Any) -> Any:
    request = ffi.new("pmBatchedData *")
    request.fields = fields.value
    request.floatArray = floats
    request.intArray = integers
    return request


def _words(array: Any) -> np.ndarray:
    """One of pymunk's arrays as two int64: its counter in the low half, its numbers' address."""
    return np.frombuffer(ffi.buffer(array, 16), np.int64)
