"""Shares of mappers that survive faults on purpose, and what is promised of them.

A robot is guided from room to room of a random building, in continuous motion, by a guide that
knows the truth: so the way is the same for all mappers. After `BEFORE` metres a fault strikes once,
and the robot is guided on for `AFTER` metres more. At each reading the error of the position that
the mapper believes, relative to home, is taken down, and whether it believes to be lost.

The promises (`PROMISES`) were written down before any result was seen.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_agents.evaluation.plan import parse_seeds
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.evaluation.intervals import wilson
from albot_core.files import make_folder, write_text
from albot_core.geometry.poses import inverse, relative
from albot_core.geometry.types import Segments
from albot_core.mappers.registry import mapper_spec
from albot_core.planning.leading import Driving
from albot_env.faults.registry import FAULTS
from albot_env.faults.world_faults import HEAVY
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.driving import DrivingTask
from albot_env.tasks.core.observation import ObservationConfig
from albot_env.tasks.core.settings import equip
from albot_env.tasks.place_recognition.tours import StoppingRooms
from albot_maps import World, load_world
from albot_maps.geodesic import DistanceField

BEFORE, AFTER = 30.0, 30.0
"""Path before the fault strikes, and after (m)."""
RIGHT = 2.0
"""A believed position is right up to this error (m)."""
HOME, AWAY = 1.0, 3.0
"""Home is claimed falsely where it is believed within the first distance (m), by a robot that does
not believe to be lost, and is farther than the second (m)."""
MAPPERS = (
    "albot1",
    "association",
    "ratslam",
    "graph-slam",
    "scan-matching",
    "gmapping",
    "odometry",
)
"""The mappers that are measured by default."""
WORLDS = "random:office:SEED?rooms=8"
DRIVING = Driving(speed=0.6, turn_rate=math.radians(45.0))
_ROOM = 0.1
"""Extra distance from walls where there is room (m)."""
_PATIENCE = 30
"""Number of steps without progress after which the guide chooses another room."""
_MOST_STEPS = 6000
"""Number of steps after which a run ends anyway."""


@dataclass(frozen=True, kw_only=True)
class Promise:
    """What a mapper is promised to do when a fault strikes."""

    goes_on: float | None = None
    """From so many metres after the strike's end on, its position is right to the end, or it says
    that it is lost where that is allowed; None: nothing."""
    may_be_lost: bool = False
    """Whether to say `lost` at the end keeps the promise."""

    def __str__(self) -> str:
        if self.goes_on is None:
            return "nothing"
        lost = ", or says that it is lost" if self.may_be_lost else ""
        return f"is right again within {self.goes_on:g} m{lost}"


NOTHING = Promise()
GOES_ON = Promise(goes_on=10.0)
RECOVERS = Promise(goes_on=30.0, may_be_lost=True)
_HARMLESS = (
    "laser-dropout", "stuck-beams", "blind-sector", "frozen-scan", "saturated-sonars",
    "lost-readings", "doubled-readings", "swapped-readings", "late-readings",
    "door-shut", "furniture-moved", "person-in-exit",
)  # fmt: skip
"""Faults after which the odometer is as good as before."""
_ODOMETER = "odometer-jump", "frozen-odometer", "wheel-slip"
_CARRIED = "kidnap", "turned"
PLACES = ("albot1",)
"""The mappers that can say that they are lost."""
BLIND = ("odometry",)
"""The mappers that see nothing by which an odometer could be corrected."""


def promise(fault: str, mapper: str) -> Promise:
    """Return what a mapper is promised to do when a fault strikes."""
    if fault in _HARMLESS or (fault in _ODOMETER and mapper not in BLIND):
        return GOES_ON
    return RECOVERS if fault in _CARRIED and mapper in PLACES else NOTHING


@dataclass(frozen=True, kw_only=True)
class Survival:
    """How a mapper came through one strike."""

    fault: str
    mapper: str
    seed: int
    struck: bool
    """Whether the fault could strike in this world."""
    error_before: float
    """Error of the position just before the strike (m)."""
    error: float
    """The same at the end (m)."""
    right_again: float | None
    """Path from the strike's end until the position is right for good (m); None if it is not."""
    said_lost: bool
    """Whether the mapper said after the strike that it is lost."""
    lost: bool
    """Whether it says so at the end."""
    false_home: bool
    """Whether it claimed home falsely after the strike."""

    @property
    def mistaken(self) -> bool:
        """Whether, at the end, it believes in a wrong position."""
        return not self.lost and self.error > RIGHT

    def keeps(self, promised: Promise) -> bool:
        """Whether a promise was kept."""
        if self.false_home and self.mapper in PLACES:
            return False
        if promised.may_be_lost and self.lost:
            return True
        limit = promised.goes_on
        return self.right_again is not None and limit is not None and self.right_again <= limit


def robot_with(mapper: str, fault: str) -> DrivingTask:
    """Return a robot that a fault strikes after `BEFORE` metres; with a camera for its mapper.

    Raises:
        InputError: The mapper or the fault is unknown.
    """
    camera = "ambiguous" if "scene" in mapper_spec(mapper).sensors else "none"
    equipment = equip(
        mapper=mapper,
        mapper_config=None,
        odometer="pioneer",
        laser="lms-200",
        sonar="pioneer",
        scenes=camera,
        compass="none",
        movables=True,
        reveal=False,
        faults=f"{fault}:at={BEFORE:g}m",
        saved_map=None,
        extend_map=False,
        robot="pioneer-3dx",
        threads=1,
        environment="fault-survival",
    )
    seen = ObservationConfig(parts=("motion",))
    return DrivingTask(1, equipment, actions=ActionConfig(), observations=seen)


def survive(robot: DrivingTask, world: World, fault: str, mapper: str, seed: int) -> Survival:
    """Guide a robot through a world, let the fault strike, and guide it on."""
    rng = np.random.default_rng((seed, 1))
    robot.begin(0, world, world.starts[0], np.random.default_rng(seed))
    robot.observe()
    guide = _guided(robot, rng)
    rows = [_row(robot)]
    for _ in range(_MOST_STEPS):
        robot.drive(next(guide)[np.newaxis])
        robot.observe()
        rows.append(_row(robot))
        if rows[-1][0] >= BEFORE + AFTER:
            break
    path, errors, lost, false, active, struck = (
        np.array(column) for column in zip(*rows, strict=True)
    )
    begun = np.flatnonzero(struck)
    if not len(begun):
        begun = np.array([len(path) - 1])
    after = slice(int(begun[0]), None)
    ended = np.flatnonzero(active)
    end = path[ended[-1]] if len(ended) else path[after][0]
    is_wrong = (errors > RIGHT) | lost.astype(bool)
    wrong = np.flatnonzero(is_wrong[after])
    again: float | None = 0.0
    if len(wrong):
        last = int(wrong[-1]) + 1
        again = None if last >= len(path[after]) else max(0.0, float(path[after][last] - end))
    return Survival(
        fault=fault,
        mapper=mapper,
        seed=seed,
        struck=bool(struck.any()),
        error_before=round(float(errors[max(0, int(begun[0]) - 1)]), 2),
        error=round(float(errors[-1]), 2),
        right_again=again,
        said_lost=bool(lost[after].any()),
        lost=bool(lost[-1]),
        false_home=bool(false[after].any()),
    )


def _row(robot: DrivingTask) -> tuple[float, float, bool, bool, bool, bool]:
    """Return path, error, and whether it is lost, claims home falsely, is and was struck."""
    believed = inverse(robot.homes_in_robot[0])  # The robot's pose, seen from home.
    true = relative(robot.starts[0], robot.poses[0])
    lost, facts = bool(robot.lost[0]), robot.facts
    near, far = math.hypot(*believed[:2]), math.hypot(*true[:2])
    return (
        float(robot.path_lengths[0]),
        float(np.hypot(*(believed - true)[:2])),
        lost,
        not lost and near < HOME and far > AWAY,
        bool(facts["fault"][0]),
        bool(facts["faults_struck"][0]),
    )


def _guided(robot: DrivingTask, rng: np.random.Generator) -> Iterator[np.ndarray]:
    """Yield the commands that lead a robot from room to room, whatever happens to it."""
    stops = StoppingRooms(robot.world(0))
    while True:
        goal = stops.point(int(rng.choice(stops.rooms)), rng)
        world = robot.world(0)
        way = DistanceField(_in_the_way(world), world.robot_radius, goal, spare=_ROOM).path(
            robot.poses[0, :2]
        )
        if not len(way):
            yield np.zeros(2)
        for waypoint in way:
            patience, nearest, moved = _PATIENCE, math.inf, robot.poses[0].copy()
            while patience and (c := DRIVING.command_towards(waypoint, robot.poses[0])) is not None:
                yield c
                away = float(np.hypot(*(waypoint - robot.poses[0, :2])))
                turned = abs(robot.poses[0, 2] - moved[2]) > 0.01
                is_carried = np.hypot(*(robot.poses[0] - moved)[:2]) > 0.5
                moved = robot.poses[0].copy()
                patience = _PATIENCE if away < nearest - 0.01 or turned else patience - 1
                nearest = min(nearest, away)
                if is_carried or robot.world(0) is not world:
                    patience = 0
            if not patience:
                break


def _in_the_way(world: World) -> Segments:
    """Return walls, and the sides of what stands in exits."""
    boxes = [box.corners for box in world.movables.boxes if box.mass == HEAVY]
    sides = [np.concatenate((box, np.roll(box, -1, axis=0)), axis=1) for box in boxes]
    return np.concatenate((world.walls, *sides))


def measure_all(
    faults: Sequence[str], mappers: Sequence[str], seeds: range, worlds: str = WORLDS
) -> list[Survival]:
    """Let each fault strike each mapper in each world.

    Raises:
        InputError: A fault or a mapper is unknown, or a world cannot be loaded.
    """
    unknown = [fault for fault in faults if fault not in FAULTS]
    if unknown:
        raise InputError("--fault", f"one of {', '.join(FAULTS)}", unknown[0])
    for mapper in mappers:
        robot_with(mapper, faults[0]).close()
    buildings = {seed: load_world(worlds.replace("SEED", str(seed))) for seed in seeds}
    total, done = len(faults) * len(mappers) * len(seeds), []
    with progress("fault-survival", total, "runs") as update:
        for mapper in mappers:
            for fault in faults:
                robot = robot_with(mapper, fault)
                for seed in seeds:
                    done.append(survive(robot, buildings[seed], fault, mapper, seed))
                    update(len(done))
                robot.close()
    return done


Figures = Mapping[str, Any]


def figures(runs: Sequence[Survival], seeds: range, worlds: str = WORLDS) -> dict[str, Any]:
    """Return what JSON holds of the runs, and the counts for the table."""
    faults, mappers = (
        list(dict.fromkeys(getattr(run, name) for run in runs)) for name in ("fault", "mapper")
    )
    rows = []
    for fault in faults:
        for mapper in mappers:
            own = [r for r in runs if (r.fault, r.mapper) == (fault, mapper) and r.struck]
            promised, count = promise(fault, mapper), len(own)
            kept = sum(run.keeps(promised) for run in own)
            rows.append(
                {
                    "fault": fault,
                    "mapper": mapper,
                    "promise": str(promised),
                    "runs": count,
                    "kept": kept,
                    "interval": list(wilson(kept, count)) if count else None,
                    "right_at_end": sum(r.error <= RIGHT and not r.lost for r in own),
                    "said_lost": sum(r.said_lost for r in own),
                    "mistaken": sum(r.mistaken for r in own),
                    "mistaken_after_lost": sum(r.mistaken and r.said_lost for r in own),
                    "false_home": sum(r.false_home for r in own),
                }
            )
    return {
        "worlds": worlds,
        "seeds": f"{seeds[0]}..{seeds[-1]}",
        "rows": rows,
        "runs": [asdict(run) for run in runs],
    }


def table(measured: Figures) -> str:
    """Return the table in Markdown: of each fault and mapper, how often the promise holds."""
    rows = measured["rows"]
    mappers = list(dict.fromkeys(row["mapper"] for row in rows))
    lines = [f"| fault | {' | '.join(f'`{name}`' for name in mappers)} |"]
    lines.append("|---|" + "---|" * len(mappers))
    for fault in dict.fromkeys(row["fault"] for row in rows):
        cells = [_cell(row) for row in rows if row["fault"] == fault]
        lines.append(f"| `{fault}` | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _cell(row: Figures) -> str:
    if not row["runs"]:
        return "no strike"
    end = f"right at the end {row['right_at_end']} of {row['runs']}"
    if row["promise"] == str(NOTHING):
        return f"({end})"
    low, high = row["interval"]
    lost = f", lost {row['said_lost']}" if row["said_lost"] else ""
    return f"**{row['kept']} of {row['runs']}** ({low:.0%} to {high:.0%}){lost}"


def page(measured: Figures, command_line: str) -> str:
    """Return the section in Markdown."""
    promises = "\n".join(
        f"- `{fault}`: "
        + "; ".join(
            f"{' and '.join(f'`{name}`' for name in names)} {text}"
            for text, names in _promised(measured, fault).items()
        )
        + "."
        for fault in dict.fromkeys(row["fault"] for row in measured["rows"])
    )
    return (
        "## Faults on purpose\n\n"
        f"A robot is guided from room to room ({measured['worlds']}, seeds {measured['seeds']}). "
        f"After {BEFORE:g} m a fault strikes once (docs/faults.md), with its usual parameters; the "
        f"robot is guided on for {AFTER:g} m. A position is right if its error relative to home is "
        f"at most {RIGHT:g} m. What was promised, before any result was seen, and how often it "
        f"held, with 95 % Wilson intervals; in brackets, where nothing is promised, how often the "
        f"position was right at the end:\n\n{table(measured)}\n{promises}\n\n"
        f"`albot1` also promises never to believe to be at home, within {HOME:g} m, where it is "
        f"more than {AWAY:g} m away, unless it says that it is lost.\n\n"
        f"Measured by `{command_line}`.\n"
    )


def _promised(measured: Figures, fault: str) -> dict[str, list[str]]:
    """Return the mappers by what is promised of them when a fault strikes."""
    found: dict[str, list[str]] = {}
    for row in measured["rows"]:
        if row["fault"] == fault:
            found.setdefault(row["promise"], []).append(row["mapper"])
    return found


@click.command()
@click.option("--fault", "faults", multiple=True, help="Only this one; repeatable.  [default: all]")
@click.option("--mapper", "mappers", multiple=True, default=MAPPERS, show_default=True)
@click.option("--worlds", default=WORLDS, show_default=True, help="SEED stands for each seed.")
@click.option("--seeds", default="1000..1019", show_default=True)
@click.option("--out", type=PathType(), help="Folder for fault_survival.json and .md.")
def command(
    faults: tuple[str, ...], mappers: tuple[str, ...], worlds: str, seeds: str, out: Path | None
) -> None:
    """Let faults strike mappers, and count how often what is promised holds."""
    chosen = parse_seeds(seeds)
    if out is not None:
        make_folder(out)
    runs = measure_all(faults or tuple(FAULTS), mappers, chosen, worlds)
    measured = figures(runs, chosen, worlds)
    click.echo(table(measured), nl=False)
    if out is not None:
        options = "".join(f" --fault {each}" for each in faults)
        options += "".join(f" --mapper {each}" for each in mappers if mappers != MAPPERS)
        options += "" if worlds == WORLDS else f" --worlds '{worlds}'"
        line = f"albot experiment study fault-survival{options} --seeds {seeds} --out OUT"
        write_text(out / "fault_survival.json", json.dumps(measured, indent=1) + "\n")
        write_text(out / "fault_survival.md", page(measured, line))
        click.echo(f"{out / 'fault_survival.json'}\n{out / 'fault_survival.md'}")
