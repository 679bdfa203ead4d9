"""The compiled worth of driving home."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from albot_core.geometry.directions import length_of
from albot_core.kernels.arguments import KernelArguments, KernelDispatcher, unpack
from albot_core.kernels.compiled import kernel
from albot_env.tasks.standing import follow
from albot_maps.geodesic_kernel import FAR, first_anchor

TERMS = ("success", "false_declaration", "progress", "facing", "collision", "time")
"""The reward's terms, in the order of the columns of `Standing.terms`."""


class Fields(NamedTuple):
    """The true ways home of all robots, a row each (see `albot_maps.geodesic`)."""

    anchor_of: np.ndarray
    """(n, points) int32."""
    anchors: np.ndarray
    """(n, most, 4) float64."""
    shapes: np.ndarray
    """(n, 2) int64: columns, and points in each."""
    corners: np.ndarray
    """(n, 3) float64: where the first point lies, and the cell (m)."""


class Homecoming(NamedTuple):
    """How far robots have come on their way home, a row each."""

    distances: np.ndarray
    """(n,) float64: the true way home (m)."""
    initial: np.ndarray
    """(n,) float64: the same at the beginning (m)."""
    aversions: np.ndarray
    """(n,) float64: how far it looks away from where that turns next, from 0 to 1 right behind."""
    driven: np.ndarray
    """(n,) float64: how far it has truly driven since (m)."""
    turns: np.ndarray
    """(n, 2) float64: where the true way home turns next (m, world frame)."""
    declares: np.ndarray
    """(n,) bool: whether its action declares that this is home."""
    declared: np.ndarray
    """(n,) bool: whether it has declared so."""
    success: np.ndarray
    """(n,) bool: whether that was true."""
    spl: np.ndarray
    """(n,) float64: success weighted by path length."""
    soft_spl: np.ndarray
    """(n,) float64: the same with the share of the way covered in place of success."""


@kernel()
def find_way(i: int, x: float, y: float, fields: Fields, homecoming: Any) -> None:
    """Note how far it is home from x, y for robot i, and where the way turns.

    `homecoming` has `distances` and `turns`. Where no way is near, they keep what they were: the
    robot is pushed into a corner.
    """
    corner = fields.corners[i]
    cell = corner[2]
    u, v = (x - corner[0]) / cell, (y - corner[1]) / cell
    columns, rows = fields.shapes[i]
    anchors = fields.anchors[i]
    a = first_anchor(u, v, columns, rows, anchors, fields.anchor_of[i])
    if a == FAR:
        return
    ahead = anchors[a]
    homecoming.distances[i] = (ahead[2] + length_of(u - ahead[0], v - ahead[1])) * cell
    homecoming.turns[i, 0] = ahead[0] * cell + corner[0]
    homecoming.turns[i, 1] = ahead[1] * cell + corner[1]


@kernel()
def success_weighted(success: float, geodesic: float, driven: float) -> float:
    """Success weighted by path length: success × shortest way / the longer of it and that driven.

    Anderson et al., On Evaluation of Embodied Navigation Agents, 2018, section 3. Where
    both ways are nothing, so is the detour.
    """
    longest = max(geodesic, driven)
    return success if longest <= 0.0 else success * (geodesic / longest)


@kernel()
def _aversion(pose: np.ndarray, turn: np.ndarray) -> float:
    """How far a robot looks away from a point, (1 - cos) / 2: 0 ahead, 1 right behind."""
    east, north = turn[0] - pose[0], turn[1] - pose[1]
    away = length_of(east, north)
    if away == 0.0:
        return 0.0
    return float(0.5 - 0.5 * (math.cos(pose[2]) * east + math.sin(pose[2]) * north) / away)


@KernelDispatcher
@kernel(nogil=True)
def appraise_homing(rows: np.ndarray, arguments: KernelArguments, elapsed: float) -> None:
    """Bring the standing of robots up to date after a survey, at the end of a step (s).

    `arguments` holds the weights (terms,) and the discount of the reward, how near home (m)
    counts as home, the area (m²) of a cell of ground, whether each robot touched something
    (n,), `Fields`, `Senses`, `Findings`, `Standing` and `Homecoming`.
    """
    weights, discount, radius, cell_area, collided, fields, senses, findings, standing, h = unpack(
        arguments
    )
    for i in rows:
        moved = follow(i, cell_area, senses, findings, standing)
        before, averse = h.distances[i], h.aversions[i]
        pose, start, terms = senses.poses[i], standing.starts[i], standing.terms[i]
        find_way(i, pose[0], pose[1], fields, h)
        h.aversions[i] = _aversion(pose, h.turns[i])
        h.declared[i] = h.success[i] = False
        if standing.steps[i] == 0:
            h.initial[i], h.driven[i] = h.distances[i], 0.0
        else:
            h.driven[i] += moved
            if h.declares[i]:
                h.declared[i] = True
                apart = length_of(pose[0] - start[0], pose[1] - start[1])
                h.success[i] = apart <= radius
            after = 0.0 if h.declared[i] else h.distances[i]
            averse_after = 0.0 if h.declared[i] else h.aversions[i]
            terms[0] = weights[0] if h.success[i] else 0.0
            terms[1] = weights[1] if h.declared[i] and not h.success[i] else 0.0
            terms[2] = weights[2] * (before - discount * after)
            terms[3] = weights[3] * (averse - discount * averse_after)
            terms[4] = weights[4] if collided[i] else 0.0
            terms[5] = weights[5] * elapsed
        h.spl[i] = success_weighted(1.0 if h.success[i] else 0.0, h.initial[i], h.driven[i])
        covered = 1.0
        if h.initial[i] > 0.0:
            covered = min(1.0, max(0.0, 1.0 - h.distances[i] / h.initial[i]))
        h.soft_spl[i] = success_weighted(covered, h.initial[i], h.driven[i])
        standing.rewards[i] = (
            terms[0] + terms[1] + terms[2] + terms[3] + terms[4] + terms[5]
        )  # In this order, as the sum of the terms by name is.
