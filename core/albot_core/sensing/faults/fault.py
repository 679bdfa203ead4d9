"""Faults and their schedules: what strikes, when, for how long, and how often.

A fault is a frozen dataclass of quantities (`Span`), of which each strike draws its own. All draws
of a strike come from a random stream of its own, which the seed, the fault's position in the list
and the strike's number select. So a schedule depends on the seed alone, and disturbs no other
random numbers.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from albot_core.errors import InputError
from albot_core.sensing.faults.span import METRES, SECONDS, Span, parse_span
from albot_core.sensing.reading import Sensor

Need = Sensor | Literal["contact", "world", "movables"]
"""What a fault needs: a sensor; a robot that can feel contact; a simulated world; or one in which
doors, boxes and people are simulated."""
LONGEST = 1e6
"""Largest time (s) and distance (m) of a schedule."""
_WHEN = METRES, SECONDS


class Clock(NamedTuple):
    """What a schedule is measured by."""

    time: float
    """Time since the first reading (s)."""
    travelled: float
    """Distance driven since the first reading (m)."""

    def value(self, unit: str) -> float:
        """Return the distance (m) or the time (s), as the unit says."""
        return self.travelled if unit == METRES else self.time


def quantity(
    default: str, *units: str, least: float = 0.0, most: float = LONGEST, optional: bool = False
) -> Any:
    """Return the field of a fault for a quantity.

    Args:
        default: Its default, as text; empty for none.
        units: The units that it may have.
        least: Smallest number, in the unit.
        most: Largest number, in the unit.
        optional: Whether it may be None.
    """
    value = parse_span(default, "fault", "default") if default else None
    allowed = {"units": units, "least": least, "most": most, "optional": optional}
    return dataclasses.field(default=value, metadata=allowed)


@dataclass(frozen=True, kw_only=True)
class Fault:
    """A fault: what happens at a strike, and when it strikes.

    Raises:
        InputError: A quantity has another unit or is out of range.
    """

    name: ClassVar[str] = "fault"
    """Its name in specs."""
    summary: ClassVar[str] = ""
    """What happens, in one sentence."""
    needs: ClassVar[tuple[Need, ...]] = ()
    """What it needs."""
    at: Span = quantity("5..15m", *_WHEN)
    """The first strike: the distance driven, or the time, since the first reading."""
    every: Span | None = quantity("", *_WHEN, least=1e-3, optional=True)
    """Distance or time from the end of a strike to the next one; none for a single strike."""

    def __post_init__(self) -> None:
        for each in dataclasses.fields(self):
            self._check(each.name, getattr(self, each.name), each.metadata)

    def _check(self, name: str, value: Any, allowed: Any) -> None:
        source = f"fault {self.name}"
        if value is None and allowed["optional"]:
            return
        units, least, most = allowed["units"], allowed["least"], allowed["most"]
        if not isinstance(value, Span) or value.unit not in units:
            expected = f"a quantity in {' or '.join(units)}"
            raise InputError(source, expected, str(value), place=name)
        if not least <= value.low <= value.high <= most:
            expected = f"numbers within [{least:g}, {most:g}] {value.unit}"
            raise InputError(source, expected, str(value), place=name)

    @property
    def spec(self) -> str:
        """The text by which the registry makes an equal fault: only what is not the default."""
        changed = [
            f"{each.name}={getattr(self, each.name)}"
            for each in dataclasses.fields(self)
            if getattr(self, each.name) != each.default
        ]
        return f"{self.name}:{','.join(changed)}" if changed else self.name


@dataclass(frozen=True, kw_only=True)
class LastingFault(Fault):
    """A fault whose strikes last for a while."""

    lasting: Span = quantity("0.5..5s", *_WHEN, least=1e-3)
    """How long a strike lasts: a time, or a distance driven."""


_SCHEDULE = ("at", "every", "lasting")
"""The quantities of a schedule; the others belong to what happens."""


class Strikes:
    """The strikes of one fault on one robot: the present one, or else the next.

    Args:
        fault: The fault.
        seed: Selects the random stream.
    """

    def __init__(self, fault: Fault, seed: tuple[int, ...]) -> None:
        self.fault = fault
        self._seed = seed
        self.number = 0
        """Number of the strike, counted from 0."""
        self.is_on = False
        """Whether it is under way."""
        self.until = math.inf
        """Time or distance at which it ends, if it is under way."""
        self._draw(0.0)

    @property
    def count(self) -> int:
        """Number of strikes that have begun."""
        return self.number + self.is_on

    def _draw(self, before: float) -> None:
        """Draw the strike with the present number, after a time or distance."""
        fault, first = self.fault, self.number == 0
        gap = fault.at if first else fault.every
        self.rng = np.random.default_rng((*self._seed, self.number))
        """Random numbers of the strike, after those of its schedule and its quantities."""
        self.begins = math.inf if gap is None else before + gap.draw(self.rng)
        self._unit = METRES if gap is None else gap.unit
        self._lasting = fault.lasting if isinstance(fault, LastingFault) else None
        self._length = 0.0 if self._lasting is None else self._lasting.draw(self.rng)
        self.values = {
            each.name: getattr(fault, each.name).draw(self.rng)
            for each in dataclasses.fields(fault)
            if each.name not in _SCHEDULE
        }
        """The quantities of the strike (m, s, rad, or shares), by name."""

    def begin(self, clock: Clock) -> bool:
        """Begin the strike if it is due; return whether it begins now."""
        if self.is_on or clock.value(self._unit) < self.begins:
            return False
        self.is_on = True
        if self._lasting is not None:
            self.until = clock.value(self._lasting.unit) + self._length
        return True

    def is_over(self, clock: Clock) -> bool:
        """Whether the strike under way has lasted long enough."""
        return self._lasting is None or bool(clock.value(self._lasting.unit) >= self.until)

    def end(self, clock: Clock) -> None:
        """End the strike, and draw the next."""
        self.number, self.is_on, self.until = self.number + 1, False, math.inf
        every = self.fault.every
        self._draw(0.0 if every is None else clock.value(every.unit))

    @property
    def state(self) -> np.ndarray:
        """Its state, (4,) float64: number, whether it is under way, beginning and end."""
        return np.array((self.number, self.is_on, self.begins, self.until), np.float64)

    def restore(self, state: np.ndarray) -> None:
        """Go on from a state of the same fault with the same seed."""
        self.number, self.is_on = int(state[0]), bool(state[1])
        self._draw(0.0)
        self.begins, self.until = float(state[2]), float(state[3])
