"""Checks of what a mapper returns, because mappers may come from outside the project."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping, Sequence
from typing import TypeGuard

import numpy as np

from albot_core.errors import InputError
from albot_core.mappers.mapper import TRAVEL, Estimate, MapperSpec
from albot_core.maps.activity import Activity
from albot_core.maps.layer_checks import layer_fault
from albot_core.maps.layers import LAYERS, MapSnapshot
from albot_core.ranges import COUNT, FINITE

_POSE = 3
"""Numbers of a pose: x, y, heading."""
_MATCH = 6
"""Numbers of each of `PlaceMatches`."""
_WAY_HOME = 7
"""Numbers of a `WayHome`."""


def is_from_outside(spec: MapperSpec) -> bool:
    """Return whether a mapper is not the project's own; what those return is checked by tests."""
    return not spec.factory.startswith("albot_core.")


def check_estimate(estimate: object, spec: MapperSpec, reading: int) -> None:
    """Check an estimate.

    Args:
        estimate: The estimate.
        spec: The mapper's spec.
        reading: Number of the reading after which it was made, counted from 0 since the reset; -1
            before the first.

    Raises:
        InputError: It is no `Estimate`, its pose or home is not an array of three finite numbers,
            the matched reading is no earlier one, or another field is not as `Estimate` says.
    """
    if not isinstance(estimate, Estimate):
        raise _error(spec, reading, "estimate", "an Estimate", estimate)
    # Plain Python, because it runs at every reading and numpy is slower for three numbers.
    for name, pose in (("pose", estimate.pose), ("home", estimate.home)):
        if not (_is_array(pose, _POSE) and all(map(math.isfinite, pose.tolist()))):
            expected = "an array of 3 finite numbers, (x, y, heading)"
            raise _error(spec, reading, f"estimate.{name}", expected, pose)
    matched = estimate.matched_reading
    if matched is not None and (matched not in COUNT or matched > reading):
        expected = "the number of an earlier reading, or None"
        found = np.asarray(matched) if matched in FINITE else matched
        raise _error(spec, reading, "estimate.matched_reading", expected, found)
    for name in ("updates", "map_version", "segments"):
        if getattr(estimate, name) not in COUNT:
            found = getattr(estimate, name)
            raise _error(spec, reading, f"estimate.{name}", COUNT.expected, found)
    if estimate.place is not None and estimate.place not in COUNT:
        expected = f"{COUNT.expected}, or None"
        raise _error(spec, reading, "estimate.place", expected, estimate.place)
    if not isinstance(estimate.localised, bool | np.bool_):
        raise _error(spec, reading, "estimate.localised", "True or False", estimate.localised)


def check_way_home(way: object, spec: MapperSpec, reading: int) -> None:
    """Check a `RouteHome.way_home`; further arguments as for `check_estimate`.

    Raises:
        InputError: It is not an array of seven numbers, or the travel is NaN.
    """
    if not _is_array(way, _WAY_HOME) or math.isnan(way[TRAVEL]):
        expected = "an array of 7 numbers, of which the last is not NaN"
        raise _error(spec, reading, "way_home", expected, way)


def check_corrected_poses(poses: object, spec: MapperSpec, readings: int) -> None:
    """Check `CorrectedTrajectory.corrected_poses` after so many readings.

    Raises:
        InputError: They are not an array of finite numbers, three a reading.
    """
    if not (
        isinstance(poses, np.ndarray)
        and poses.dtype.kind in "fiu"
        and poses.shape == (readings, _POSE)
        and np.isfinite(poses).all()
    ):
        expected = f"an array of finite numbers, of shape {(readings, _POSE)}"
        raise _error(spec, readings - 1, "corrected_poses()", expected, poses)


def check_snapshot(snapshot: object, spec: MapperSpec, reading: int) -> None:
    """Check a `Mapper.snapshot`; further arguments as for `check_estimate`.

    Raises:
        InputError: It is no `MapSnapshot`, or a layer is not listed in the spec, comes twice, or is
            not as its type says.
    """
    if not isinstance(snapshot, MapSnapshot) or not isinstance(snapshot.layers, tuple):
        expected = "a MapSnapshot with a tuple of layers"
        raise _error(spec, reading, "snapshot()", expected, snapshot)
    allowed = {LAYERS[kind] for kind in spec.layers}
    for k, layer in enumerate(snapshot.layers):
        where = f"snapshot().layers[{k}]"
        if type(layer) not in allowed:
            expected = f"a layer of its spec, once each: {', '.join(spec.layers) or 'none'}"
            raise _error(spec, reading, where, expected, layer)
        allowed.remove(type(layer))
        if fault := layer_fault(layer):
            raise _error(spec, reading, f"{where}.{fault.place}", fault.expected, fault.found)


def check_place_matches(matches: object, spec: MapperSpec, reading: int) -> None:
    """Check `Recognition.place_matches`; further arguments as for `check_estimate`.

    Raises:
        InputError: They are not an array of finite numbers with six columns, a score, probability
            or ambiguity is not within 0 and 1, or a reading is no earlier one.
    """
    if not (
        isinstance(matches, np.ndarray)
        and matches.dtype.kind in "fiu"
        and matches.ndim == 2
        and matches.shape[1] == _MATCH
        and np.isfinite(matches).all()
    ):
        expected = f"an array of finite numbers with {_MATCH} columns"
        raise _error(spec, reading, "place_matches()", expected, matches)
    shares, numbers = matches[:, :3], matches[:, 5]
    if not ((shares >= 0) & (shares <= 1)).all():
        expected = "scores, probabilities and ambiguities within 0 and 1"
        raise _error(spec, reading, "place_matches()", expected, shares)
    if not ((numbers >= 0) & (numbers <= reading) & (numbers % 1 == 0)).all():
        expected = "numbers of earlier readings in the last column"
        raise _error(spec, reading, "place_matches()", expected, numbers)


def check_state(state: object, spec: MapperSpec, reading: int | None = None) -> None:
    """Check a `Mapper.state`; further arguments as for `check_estimate`, but None for no reading.

    Raises:
        InputError: It is no mapping, a name is no text, or an array is not one of numbers.
    """
    if not isinstance(state, Mapping):
        raise _error(spec, reading, "state()", "arrays of numbers by name", state)
    for name, array in state.items():
        if not isinstance(name, str):
            raise _error(spec, reading, "state()", "arrays of numbers by name", name)
        if not isinstance(array, np.ndarray) or array.dtype.kind not in "biuf":
            raise _error(spec, reading, f"state()[{name!r}]", "an array of numbers", array)


def check_events(events: object, spec: MapperSpec, reading: int) -> None:
    """Check a `PlaceMemory.events`; further arguments as for `check_estimate`.

    Raises:
        InputError: It is no sequence, or is text.
    """
    if not isinstance(events, Sequence) or isinstance(events, str | bytes):
        raise _error(spec, reading, "events", "a sequence with an item an event", events)


def check_place(place: object, spec: MapperSpec, reading: int) -> None:
    """Check what `PlaceMemory.place_at` returns for a reading.

    Raises:
        InputError: It is no id of a place.
    """
    if place not in COUNT:
        raise _error(spec, reading, "place_at()", COUNT.expected, place)


def check_activity(activity: object, spec: MapperSpec, reading: int) -> None:
    """Check an `AttractorNetwork.activity`; further arguments as for `check_estimate`.

    Raises:
        InputError: It is no `Activity`, or its packet is not an array of three finite numbers.
    """
    if not isinstance(activity, Activity):
        raise _error(spec, reading, "activity", "an Activity", activity)
    packet = activity.packet
    if not (_is_array(packet, _POSE) and np.isfinite(packet).all()):
        expected = "an array of 3 finite numbers, (x', y', heading)"
        raise _error(spec, reading, "activity.packet", expected, packet)


def check_array(
    array: object, name: str, kind: type[np.generic], shape: tuple[int, ...], spec: MapperSpec
) -> None:
    """Check that a batch's array can be read by compiled code.

    Args:
        array: The array.
        name: Its name in `MapperBatch`.
        kind: Type of its numbers.
        shape: Its shape.
        spec: The mappers' spec.

    Raises:
        InputError: It is something else, or its numbers are not side by side in memory.
    """
    if isinstance(array, np.ndarray) and array.dtype == kind and array.shape == shape:
        if array.flags.c_contiguous:
            return
        found = "one that is not contiguous"
    elif isinstance(array, np.ndarray):
        found = f"one of {array.dtype} of shape {array.shape}"
    else:
        found = f"a {type(array).__name__}, {reprlib.repr(array)}"
    expected = f"a contiguous array of {np.dtype(kind)} of shape {shape}"
    raise InputError(f"mapper {spec.name}, batch", expected, found, place=name)


def _is_array(value: object, size: int) -> TypeGuard[np.ndarray]:
    return isinstance(value, np.ndarray) and value.shape == (size,) and value.dtype.kind in "fiu"


def _error(
    spec: MapperSpec, reading: int | None, name: str, expected: str, value: object
) -> InputError:
    when = ""
    if reading is not None:
        when = f"reading {reading}, " if reading >= 0 else "before the first reading, "
    if not isinstance(value, np.ndarray):
        found = f"a {type(value).__name__}, {reprlib.repr(value)}"
    elif value.size > _WAY_HOME:
        kind = "" if value.dtype.kind in "fiu" else f" of {value.dtype}"
        found = f"an array{kind} of shape {value.shape}"
        if value.dtype.kind == "f" and not np.isfinite(value).all():
            found += f", not finite at {tuple(np.argwhere(~np.isfinite(value))[0].tolist())}"
    else:
        found = str(value.tolist())
    return InputError(f"mapper {spec.name}", expected, found, place=f"{when}{name}")
