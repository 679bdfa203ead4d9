"""HSSH's gateways on real floor plans: how many are doors, and how many doors are found."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from albot_core.mappers.hssh.clearance import distances
from albot_core.mappers.hssh.gateways import FREE, WALL, GatewayConfig, Ground, find_gateways
from albot_experiments.registry import data_folder
from albot_experiments.report import Figures, Report, each_seed
from albot_maps import World, load_world

ID = "hssh-gateways"
PAPER: dict[str, Any] = {}
"""The paper gives no figures."""
TITLE = "HSSH's gateways on real floor plans (after Beeson et al. 2010, section 5)"
CELL = 0.05
"""Side of a cell (m), that of the mapper."""
HOLLOW = 0.3
"""Distance of two faces up to which they are those of one wall (m)."""
NEAR = 0.75
"""Largest distance between the middles of a gateway and of its door (m)."""
ASKED = 0.8
"""Recall of the doors, and precision of the gateways in rooms, that are asked for."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """The gateways of a plan."""

    gateways: int
    """Number of gateways."""
    right: int
    """Number of gateways that are at a door."""
    unnamed: int
    """Number of the others in corridors or outside of the building, where the plan names none."""
    doors: int
    """Number of doors."""
    met: int
    """Number of doors with a gateway."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Find the gateways of all plans; a seed turns the plans by an angle of its own.

    Raises:
        InputError: No seeds, or no plans.
    """
    files = sorted((data_folder() / "plans").glob("*.xml"))
    if not files:
        raise InputError(data_folder() / "plans", "floor plans", "none")
    plans = {file.stem.split("_")[0][:24]: load_world(str(file)) for file in files}
    found: dict[str, list[Found]] = {}
    for seed in each_seed(seeds, progress):
        turn = float(np.random.default_rng(seed).uniform(0.0, math.pi / 2))
        for name, plan in plans.items():
            found.setdefault(name, []).append(compare(plan, turn))
    return report(seeds, found)


def compare(plan: World, turn: float, config: GatewayConfig | None = None) -> Found:
    """Compare the gateways of a whole plan with its doors, with the plan turned first (rad)."""
    cos, sin = math.cos(turn), math.sin(turn)
    rotation = np.array(((cos, sin), (-sin, cos)))
    walls = plan.walls.reshape(-1, 2) @ rotation
    gateways = find_gateways(_ground(walls.reshape(-1, 2, 2)), config or GatewayConfig()).gateways
    middles = (gateways[:, :2] + gateways[:, 2:]) / 2
    doors = np.array([door.segment for door in plan.exits]).reshape(-1, 4)
    at_doors = ((doors[:, :2] + doors[:, 2:]) / 2) @ rotation
    away = _distances(middles, at_doors)
    is_right = away.min(axis=1, initial=np.inf) <= NEAR
    inside = [
        shapely.Polygon(room.boundary @ rotation).buffer(0.0)
        for room in plan.rooms
        if "corridor" not in room.name.lower()
    ]
    in_room = shapely.contains_xy(shapely.union_all(inside), middles)
    return Found(
        gateways=len(middles),
        right=int(is_right.sum()),
        unnamed=int((~is_right & ~in_room).sum()),
        doors=len(at_doors),
        met=int((away.min(axis=0, initial=np.inf) <= NEAR).sum()),
    )


def _distances(
    some: Float64[np.ndarray, "some 2"], others: Float64[np.ndarray, "others 2"]
) -> Float64[np.ndarray, "some others"]:
    return np.asarray(np.hypot(*(some[:, None] - others).transpose(2, 0, 1)))


def _ground(walls: Float64[np.ndarray, "walls 2 2"]) -> Ground:
    """Return the cells of a plan: walls where a wall passes or is hollow, else free."""
    points = walls.reshape(-1, 2)
    corner = points.min(axis=0) - 3 * CELL
    columns, rows = np.ceil((points.max(axis=0) - corner) / CELL).astype(int) + 3
    states = np.full((rows, columns), FREE, np.int8)
    lines = shapely.linestrings(walls)
    for line in lines[shapely.length(lines) > 0]:
        steps = np.arange(0.0, line.length + CELL / 4, CELL / 4)
        along = shapely.get_coordinates(shapely.line_interpolate_point(line, steps))
        at = np.floor((along - corner) / CELL).astype(int)
        states[at[:, 1], at[:, 0]] = WALL
    states[0] = states[-1] = WALL
    states[:, 0] = states[:, -1] = WALL
    # Between the two faces of a wall lies no ground, which no laser would see.
    open_ground = distances(states == FREE) > HOLLOW / 2 / CELL
    states[distances(~open_ground) > HOLLOW / 2 / CELL] = WALL
    return Ground(states, corner, CELL)


def report(seeds: range, found: dict[str, list[Found]]) -> Report:
    """Return the report of these plans."""
    names = list(found)
    every = [each for plans in found.values() for each in plans]
    others = [each for name in names[1::2] for each in found[name]]
    measured: dict[str, Figures] = {
        "seeds": len(seeds),
        "plans": len(found),
        "doors": sum(each.doors for each in every) // len(seeds),
        **_figures(every, "", len(seeds)),
        **_figures(others, "_other_half", len(seeds)),
    }
    for name, plans in found.items():
        figures = _figures(plans, "", len(seeds))
        measured[name] = {
            "doors": plans[0].doors,
            "gateways": float(np.median([each.gateways for each in plans])),
            **{key: value for key, value in figures.items() if "ci95" not in key},
        }
    gateways, right, doors, met = _sums(others)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=right >= ASKED * gateways and met >= ASKED * doors,
        text=f"""
The walls of {len(found)} real floor plans of schools and offices, in cells of {CELL:g} m, turned by
a random angle for each of the seeds {seeds.start} to {seeds.stop - 1}. On the whole plan the
gateways are found, as `hssh` finds them on its local map. A gateway is right if its middle is
within {NEAR:g} m of that of a door that the plan names; a door is found if a gateway is so near.

Gateways elsewhere need be no errors: corridors begin and cross there, or two wings of the building
come near one another. No plan names these. `precision` counts them as wrong. `precision_in_rooms`
leaves out those in rooms that the plan calls corridors, and in none of its rooms. That the others
are mostly such was found on every second plan, from the first on, and so was that the hollow of
walls, of up to {HOLLOW:g} m, must not count as ground. The figures `_other_half` are those of the
rest, which were not looked at. No threshold was chosen on any plan. The paper gives no
figures; {ASKED:.0%} of the doors, and as much precision in rooms, are asked for on the other half.
The ground around the building counts as free, too.
""",
    )


def _sums(some: Sequence[Found]) -> tuple[int, int, int, int]:
    """Return the numbers of gateways in rooms and at doors, of those at doors, doors, and found."""
    return (
        sum(each.gateways - each.unnamed for each in some),
        sum(each.right for each in some),
        sum(each.doors for each in some),
        sum(each.met for each in some),
    )


def _figures(some: Sequence[Found], suffix: str, times: int) -> dict[str, Any]:
    """Return precision and recall, with 95 % intervals, under names that end in a suffix.

    Each door was looked for several times; for the interval it counts once.
    """
    gateways, right, doors, met = _sums(some)
    of_all = sum(each.gateways for each in some)
    pairs = {
        "precision": (right, of_all),
        "precision_in_rooms": (right, gateways),
        "recall": (met, doors),
    }
    figures: dict[str, Any] = {}
    for name, (part, whole) in pairs.items():
        figures[name + suffix] = round(part / max(whole, 1), 3)
        figures[f"{name}{suffix}_ci95"] = "{:.3f} to {:.3f}".format(
            *wilson(round(part / times), round(whole / times))
        )
    return figures
