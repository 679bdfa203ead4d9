"""A random generator as an array: part of the state of a mapper that draws random numbers."""

from __future__ import annotations

import numpy as np
from jaxtyping import UInt64

from albot_core.errors import InputError

_WORD = (1 << 64) - 1


def generator_state(rng: np.random.Generator) -> UInt64[np.ndarray, "6"]:
    """Return the state of a generator of numpy's default kind (PCG64).

    Raises:
        InputError: The generator is of another kind.
    """
    state = rng.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise InputError("rng", "a PCG64 generator, as default_rng makes", state["bit_generator"])
    words = []
    for number in (state["state"]["state"], state["state"]["inc"]):
        words += [number & _WORD, number >> 64]
    return np.array((*words, state["has_uint32"], state["uinteger"]), np.uint64)


def generator_of(state: UInt64[np.ndarray, "6"]) -> np.random.Generator:
    """Return the generator with a state that `generator_state` returned."""
    low, high, inc_low, inc_high, has_half, half = (int(word) for word in state)
    bits = np.random.PCG64()
    bits.state = {
        "bit_generator": "PCG64",
        "state": {"state": low | high << 64, "inc": inc_low | inc_high << 64},
        "has_uint32": has_half,
        "uinteger": half,
    }
    return np.random.Generator(bits)
