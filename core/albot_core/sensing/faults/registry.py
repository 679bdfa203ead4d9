"""The registry of faults of readings, and specs of faults as text.

A spec is `NAME` or `NAME:KEY=VALUE,KEY=VALUE`, and several are joined by `+`:
`laser-dropout+odometer-jump:at=20m,length=3m`. A value is a number or a range `LOW..HIGH`, from
which each strike draws, with a unit: `20m`, `0.5..5s`, `30..90deg`, `50%`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from albot_core.config_document import field_docs
from albot_core.errors import InputError, did_you_mean
from albot_core.sensing.faults.delivery_faults import (
    DoubledReadings,
    LateReadings,
    LostReadings,
    SwappedReadings,
)
from albot_core.sensing.faults.effect import ReadingFault
from albot_core.sensing.faults.fault import Fault
from albot_core.sensing.faults.odometer_faults import FrozenOdometer, OdometerJump, WheelSlip
from albot_core.sensing.faults.sensor_faults import (
    BlindSector,
    FrozenScan,
    LaserDropout,
    SaturatedSonars,
    StuckBeams,
)
from albot_core.sensing.faults.span import parse_span

READING_FAULTS: Mapping[str, type[ReadingFault]] = {
    each.name: each
    for each in (
        LaserDropout, StuckBeams, BlindSector, FrozenScan, SaturatedSonars,
        OdometerJump, FrozenOdometer, WheelSlip,
        LostReadings, DoubledReadings, SwappedReadings, LateReadings,
    )
}  # fmt: skip
"""The faults of readings by name."""


def parse_faults(
    specs: Any, known: Mapping[str, type[Fault]], source: str = "faults"
) -> tuple[Fault, ...]:
    """Return the faults of a spec, or of several.

    Args:
        specs: A spec, a fault, or several of either in a sequence; None or an empty text for no
            fault.
        known: The faults that there are, by name.
        source: What the specs are given to, for errors.

    Raises:
        InputError: A fault or a parameter is unknown, or a value has no unit, or another, or is
            out of range.
    """
    if specs is None or specs == "":
        return ()
    if isinstance(specs, Fault):
        specs = (specs,)
    if isinstance(specs, str):
        specs = specs.split("+")
    if not isinstance(specs, Sequence):
        raise InputError(source, "specs of faults, as laser-dropout:at=20m", repr(specs))
    faults: list[Fault] = []
    for each in specs:
        if isinstance(each, Fault):
            faults.append(each)
        elif isinstance(each, str):
            faults += [_parse(part, known, source) for part in each.split("+")]
        else:
            raise InputError(source, "specs of faults, as laser-dropout:at=20m", repr(each))
    for fault in faults:
        if fault.name not in known:
            expected = f"one of {', '.join(known)}"
            raise InputError(source, expected, fault.name)
    return tuple(faults)


def _parse(spec: str, known: Mapping[str, type[Fault]], source: str) -> Fault:
    name, colon, rest = spec.strip().partition(":")
    if name not in known:
        found = f"{name!r}{did_you_mean(name, known)}"
        raise InputError(source, f"faults among {', '.join(known)}", found)
    kind = known[name]
    names = [each.name for each in dataclasses.fields(kind)]
    values = {}
    for part in rest.split(",") if colon else ():
        key, equals, value = part.partition("=")
        key = key.strip()
        if not equals or key not in names:
            found = f"{part.strip()!r}{did_you_mean(key, names)}"
            expected = f"parameters KEY=VALUE with a key among {', '.join(names)}"
            raise InputError(source, expected, found, place=name)
        if key in values:
            raise InputError(source, "each parameter once", f"{key} twice", place=name)
        values[key] = parse_span(value, source, f"{name}, {key}")
    try:
        return kind(**values)
    except InputError as error:
        place = f"{name}, {error.place}"
        raise InputError(source, error.expected, error.found, place=place) from None


def spec_of(faults: Iterable[Fault]) -> str:
    """Return the spec from which `parse_faults` makes the same faults."""
    return "+".join(fault.spec for fault in faults)


def check_needs(
    faults: Iterable[Fault], available: Iterable[str], whose: str, source: str = "faults"
) -> None:
    """Raise InputError if a fault needs what is not there.

    Args:
        faults: The faults.
        available: The sensors, and `contact` and `world` where there are such.
        whose: What has them, for the error: `the robot`, or the name of a log.
        source: What the faults are given to, for the error.

    Raises:
        InputError: A fault needs something that is not available.
    """
    there = set(available)
    for fault in faults:
        missing = [need for need in fault.needs if need not in there]
        if missing:
            has = ", ".join(sorted(there)) or "the odometer alone"
            expected = f"{missing[0]}, which {fault.name} needs, of {whose}"
            raise InputError(source, expected, has)


class FaultRow(NamedTuple):
    """A row of the table of faults in the documentation."""

    name: str
    summary: str
    needs: str
    parameters: str
    """Each parameter with its default and its meaning."""


def fault_rows(known: Mapping[str, type[Fault]]) -> list[FaultRow]:
    """Return what the documentation says of each fault."""
    rows = []
    for name, kind in known.items():
        whole: Any = kind  # A class is hashable, whatever its instances are.
        meanings = field_docs(whole)
        told = [
            f"`{each.name}` ({each.default}): {meanings[each.name].rstrip('.').lower()}"
            for each in dataclasses.fields(kind)
            if each.name not in ("at", "every", "lasting") and each.name in meanings
        ]
        schedule = {each.name: each.default for each in dataclasses.fields(kind)}
        when = f"`at` ({schedule['at']})"
        if "lasting" in schedule:
            when += f", `lasting` ({schedule['lasting']})"
        needs = ", ".join(kind.needs) or "-"
        rows.append(FaultRow(name, kind.summary, needs, "; ".join([when, *told])))
    return rows


def fault_table(known: Mapping[str, type[Fault]]) -> str:
    """Return the table of faults in Markdown, as the documentation has it."""
    lines = ["| fault | what happens | needs | parameters |", "|---|---|---|---|"]
    lines += [f"| `{row[0]}` | {' | '.join(row[1:])} |" for row in fault_rows(known)]
    return "\n".join(lines) + "\n"
