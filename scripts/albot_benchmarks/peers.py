"""Other simulators with a planar laser: their speed with the same robots in the same worlds."""

from __future__ import annotations

import io
import math
import os
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from itertools import cycle, islice, product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from jaxtyping import Float64

from albot_benchmarks.image_simulations import GYMKHANA, JALANSIM, JAXNAV
from albot_benchmarks.peer_simulations import (
    IRSIM,
    IRSIM_X,
    NAVGROUND,
    OURS,
    PYMUNK_LOOP,
    VMAS,
    Peer,
    Scene,
    Simulation,
)
from albot_benchmarks.timing import Workload, rates_in_turns
from albot_core.geometry.types import Segments
from albot_core.sensing.reading import LaserGeometry
from albot_env.stress.geometry import ray_ranges
from albot_maps import load_world

WORLDS = "random:office:3?rooms=10", "random:maze:1"
"""An office of 200 walls, and a maze."""
BEAMS = 64, 181
"""Numbers of beams, which share 180° ahead."""
ROUNDS = 5
TURN = 0.3
"""Shortest turn (s)."""
OFF = 0.15
"""A range is off by more than this (m): three cells of those that know the world as an image."""
MOST_OFF = 0.1
"""Share of ranges that may be off, as beams that graze a corner meet one wall or another."""

_CHECKED, _HOLD, _COMMANDS = 5, 10, 50
"""Steps before the ranges are compared; steps for which a command holds; number of commands."""

Row = dict[str, Any]


PEERS = (JALANSIM, NAVGROUND, GYMKHANA, JAXNAV, VMAS, IRSIM, IRSIM_X, PYMUNK_LOOP)
"""The simulators that PyPI has, and the loop over pymunk."""


def measure_peers(
    peers: Sequence[Peer] = PEERS,
    worlds: Sequence[str] = WORLDS,
    beams: Sequence[int] = BEAMS,
    rounds: int = ROUNDS,
) -> list[Row]:
    """Time each simulator, and ours, in the same worlds with the same beams, in turns.

    Ours has a laser without noise like the others, and an odometer. The time is processor time, so
    a simulator that uses several cores gains nothing by them.

    Returns:
        One row for each simulator that is not installed: `name` and `missing`. For each other
        simulator, ours first, one row for each world and number of beams: `name`, `version` (None
        for ours), `world`, `walls`, `beams`, `robots` (stepped at once), `steps_per_cpu_second` (of
        one robot; the median of the turns), `ratio` (ours divided by this), `range_error` (the
        median distance from the exact range, m), `off` (share of ranges that differ by more than
        `OFF`), and `wrong`, whether `off` is above `MOST_OFF`.
    """
    # For libraries that start threads of their own; they read it when they are loaded.
    os.environ["OMP_NUM_THREADS"] = "1"
    installed = [*OURS, *(peer for peer in peers if peer.version)]
    rows: list[Row] = []
    for world, number in product(worlds, beams):
        rows += _measure(installed, world, number, rounds)
    return rows + [
        {"name": peer.name, "missing": "not installed"} for peer in peers if not peer.version
    ]


def _measure(peers: Sequence[Peer], world: str, beams: int, rounds: int) -> list[Row]:
    """Return the rows of one world and number of beams."""
    geometry = LaserGeometry(beams=beams, spacing=math.pi / (beams - 1))
    rows: list[Row] = []
    workloads: dict[str, Workload] = {}
    with _silence():
        for peer in peers:
            where, commands = load_world(world), _commands(peer.robots)
            starts = np.resize(where.starts, (peer.robots, 3))
            simulation = peer.start(Scene(where, geometry, starts))
            for command in commands[:_CHECKED]:
                simulation.step(command)
            row: Row = {"name": peer.name, "version": None if peer in OURS else peer.version}
            row |= {"world": world, "walls": len(where.walls), "beams": beams}
            row |= {"robots": peer.robots} | _compared(simulation, where.walls, geometry)
            rows.append(row)
            workloads[peer.name] = _workload(simulation, commands)
        rates = rates_in_turns(workloads, rounds)
    ours = median(rate.cpu for rate in rates[OURS[0].name])
    for row in rows:
        rate = median(rate.cpu for rate in rates[row["name"]])
        row |= {"steps_per_cpu_second": rate, "ratio": ours / rate}
    return rows


@contextmanager
def _silence() -> Iterator[None]:
    """Suppress the warnings and the output of other simulators.

    Some of them reset `sys.stdout`, so the file is redirected as well.
    """
    sys.stdout.flush()
    ours = os.dup(1)
    with (
        Path(os.devnull).open("w") as nowhere,
        redirect_stdout(io.StringIO()),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        os.dup2(nowhere.fileno(), 1)
        try:
            yield
        finally:
            sys.stdout.flush()
            os.dup2(ours, 1)
            os.close(ours)


def _commands(robots: int) -> Float64[np.ndarray, "steps robots 2"]:
    """Return random speeds (m/s) and turn rates (rad/s): steps × robots × 2, held for a second."""
    drawn = np.random.default_rng(0).uniform((0, -1), (1, 1), (_COMMANDS, robots, 2))
    held: Float64[np.ndarray, "steps robots 2"] = np.repeat(drawn, _HOLD, axis=0)
    return held


def _compared(simulation: Simulation, walls: Segments, geometry: LaserGeometry) -> Row:
    """Return the errors of the ranges, compared with exact ones at the same poses."""
    exact = np.array([ray_ranges(walls, pose, geometry.bearings) for pose in simulation.poses()])
    reach = geometry.max_range
    errors = np.abs(np.minimum(simulation.ranges(), reach) - np.minimum(exact, reach))
    off = float(np.mean(~(errors <= OFF)))  # A range that is not a number is off.
    return {"range_error": float(np.median(errors)), "off": off, "wrong": off > MOST_OFF}


def _workload(simulation: Simulation, commands: Float64[np.ndarray, "steps robots 2"]) -> Workload:
    """Return a turn of at least `TURN` seconds, which continues where the last one ended."""
    ahead, began = cycle(commands), time.perf_counter()
    simulation.step(next(ahead))
    steps = max(1, math.ceil(TURN / (time.perf_counter() - began)))

    def workload() -> int:
        for command in islice(ahead, steps):
            simulation.step(command)
        return steps * len(commands[0])

    return workload
