"""Checks of the arrays of RatSLAM's state; for `restore`, which gets them from files.

Compiled code follows the chains of links and transitions and checks no bounds. An invalid number
could make it access memory that is not its own, or run for ever.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from jaxtyping import Int64

from albot_core.errors import InputError
from albot_core.mappers.ratslam.config import RatSlamConfig
from albot_core.mappers.ratslam.panoramas import BEAMS
from albot_core.mappers.stored_arrays import check_finite, check_shapes

_FINITE = (
    "numbers", "packet", "activity", "history.pose", "scans.pose", "scans.way", "scans.points",
    "templates.ranges", "templates.points", "templates.normals", "links.strength",
    "views.freshness", "waiting_numbers", "bias.ways", "events.jump", "events.turn",
    "experiences.pose", "experiences.shown", "experiences.cell", "experiences.turn",
    "experiences.way", "verification.numbers", "pending.motion", "pending.time",
    "pending.variance", "transitions.motion", "transitions.time", "transitions.stiffness",
    "transitions.weight", "transitions.most", "scenes.since_onset",
)  # fmt: skip
_NOT_NEGATIVE = (
    "activity", "links.strength", "views.freshness", "bias.ways", "transitions.time",
    "transitions.stiffness", "transitions.weight", "transitions.most", "experiences.time",
    "pending.variance", "experiences.length", "pending.time",
    "templates.ranges", "templates.profile",
)  # fmt: skip


def check_state(
    state: Mapping[str, np.ndarray], kept: Mapping[str, np.ndarray], config: RatSlamConfig
) -> None:
    """Check the arrays of a state.

    Args:
        state: The arrays, each of the same dtype and number of axes as in `kept`.
        kept: A state of a mapper with this config.
        config: The mapper's parameters.

    Raises:
        InputError: An array holds values that no state of this mapper holds.
    """
    check_shapes(state, {name: _shape(name, array) for name, array in kept.items()})
    check_finite(state, *(name for name in _FINITE if name in kept))
    for name in (name for name in _NOT_NEGATIVE if name in kept):
        if not (state[name] >= 0).all():
            raise InputError(name, "no negative numbers", "others")
    cells = config.pose_cells.columns * config.pose_cells.rows * config.pose_cells.headings
    lengths = (len(state[name]) if name in kept else 0 for name in _COUNTED)
    experiences, transitions, links, views, readings, templates, scenes = lengths
    _check_counts(state, experiences, readings, max(views, templates, scenes))
    if config.sees == "laser":
        numbers = np.arange(experiences)
        if templates != experiences or not np.array_equal(state["experiences.view"], numbers):
            raise InputError("templates", f"one an experience, {experiences}", str(templates))
        _check_within(state, "templates.known", 0, 2)
        _check_within(state, "scans.count", 0, BEAMS + 1)
    if experiences > readings:
        raise InputError("experiences", f"{readings} at most, one a reading", str(experiences))
    sides = (config.pose_cells.columns, config.pose_cells.rows, config.pose_cells.headings)
    if not all(0 <= at <= side for at, side in zip(state["packet"], sides, strict=False)):
        raise InputError("packet", f"a place among {sides} cells", str(state["packet"][:3]))
    _check_within(state, "active_cells", 0, cells)
    if len(np.unique(state["active_cells"])) < len(state["active_cells"]):
        raise InputError("active_cells", "each cell once", "one twice")
    _check_within(state, "links.cell", 0, cells)
    _check_within(state, "links.next", -1, np.arange(links))
    _check_within(state, "views.first", -1, links)
    waiting = {"waiting.view": state["waiting"][:, 0], "waiting.cell": state["waiting"][:, 1]}
    _check_within(waiting, "waiting.view", 0, views)
    _check_within(waiting, "waiting.cell", 0, cells)
    _check_within(state, "history.place", -1, experiences)
    _check_within(state, "visits.place", 0, experiences)
    _check_within(state, "last_of_view.experience", -1, experiences)
    _check_within(state, "experiences.same_view", -1, np.arange(experiences))
    _check_within(state, "experiences.entry", -1, 2 * transitions)
    _check_within(state, "experiences.onward", -1, experiences)
    _check_within(state, "experiences.reached_by", -1, transitions)
    _check_within(state, "transitions.source", 0, experiences)
    _check_within(state, "transitions.target", 0, experiences)
    _check_within(state, "transitions.ends", -1, 2 * np.arange(transitions)[:, None])
    _check_verification(state, experiences)
    _check_tree(state)
    if not _all_end(state["experiences.onward"]):
        raise InputError("experiences.onward", "ways that end", "one that runs in a circle")


_WHOLE = (
    "counts", "numbers", "packet", "scenes.counts", "scenes.since_onset", "bias.ways",
    "verification.counts", "verification.numbers",
)  # fmt: skip
"""Arrays whose lengths are fixed."""
_COUNTED = (
    "experiences.view", "transitions.source", "links.cell", "views.first", "history.place",
    "templates.ranges", "scenes.known",
)  # fmt: skip


def _shape(name: str, kept: np.ndarray) -> tuple[str | int, ...]:
    """Return an array's shape; its first axis is named by its table, the others are as kept."""
    if name in _WHOLE:
        return kept.shape
    tables = {"active_cells": "active", "activity": "active", "waiting_numbers": "waiting"}
    return tables.get(name, name.split(".")[0]), *kept.shape[1:]


def _check_within(
    state: Mapping[str, np.ndarray], name: str, least: int, end: int | Int64[np.ndarray, "..."]
) -> None:
    """Raise InputError unless all numbers are at least `least` and less than `end`."""
    numbers = state[name]
    wrong = (numbers < least) | (numbers >= end)
    if wrong.any():
        expected = f"whole numbers from {least} to less than {np.max(end, initial=0)}"
        raise InputError(name, expected, str(numbers[wrong][0]))


def _check_counts(
    state: Mapping[str, np.ndarray], experiences: int, readings: int, views: int
) -> None:
    view, place, matched, *others = state["counts"].tolist()
    if not (
        -1 <= view < max(views, 1)
        and -1 <= place < experiences
        and (place >= 0) == (experiences > 0)
        and -1 <= matched < readings
        and min(others) >= 0
    ):
        expected = "a view, a place, a reading and counts of this map"
        raise InputError("counts", expected, str(state["counts"].tolist()))


def _check_verification(state: Mapping[str, np.ndarray], experiences: int) -> None:
    anchor, hypothesis, left_in, known = state["verification.counts"].tolist()
    if not (
        -1 <= anchor < experiences
        and -1 <= hypothesis < experiences
        and 0 <= known <= experiences
        and left_in >= 0
    ):
        expected = "two experiences, an iteration and a count of this map"
        raise InputError(
            "verification.counts", expected, str(state["verification.counts"].tolist())
        )
    _check_within(state, "pending.source", 0, experiences)
    _check_within(state, "pending.target", 0, experiences)
    _check_within(state, "pending.steps", 1, np.iinfo(np.int64).max)


def _check_tree(state: Mapping[str, np.ndarray]) -> None:
    """Check that each experience but the first was reached from an older one."""
    reached_by = state["experiences.reached_by"][1:]
    numbers = np.arange(1, 1 + len(reached_by))
    if (reached_by < 0).any() or (
        (state["transitions.source"][reached_by] >= numbers)
        | (state["transitions.target"][reached_by] != numbers)
    ).any():
        expected = "transitions that lead to each experience from an older one"
        raise InputError("experiences.reached_by", expected, "others")


def _all_end(following: Int64[np.ndarray, "n"]) -> bool:
    """Return whether following these numbers leads to -1 from everywhere."""
    ahead = np.append(following, -1)
    for _ in range(len(ahead).bit_length()):
        ahead = ahead[ahead]  # Doubles the steps. The last element, at index -1, is -1.
    return bool((ahead == -1).all())
