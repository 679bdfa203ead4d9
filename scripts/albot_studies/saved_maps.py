"""Localisation in a saved map: how often, how soon and how surely robots find out where they are.

In each world a robot is led through all rooms, and a mapper makes a map by its laser and its
odometer (Pioneer). Then robots set out from random poses in random rooms, without a start pose, and
are led from room to room for 10 m. A robot is *right* if it then believes a pose within 0.5 m of
where the map has its true place: of the mapper's pose when it surveyed the nearest point, moved by
the true relative pose, so that a map's distortion is no error of localisation. It is *sure and
wrong* if it believes another pose.

Beside it: the best pose of the first scan, followed without a second look (`first match`); Monte
Carlo localisation with uniform particles (F. Dellaert and others, ICRA 1999; `particles`); the same
method without the rule of the second look (`hasty`); and robots in another building than the
map's, which must never be sure (`elsewhere`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from albot_agents.evaluation.plan import parse_seeds
from albot_benchmarks.long_run import STEPS, patrol
from albot_cli.number_types import CountType
from albot_cli.outputs import JSON
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.evaluation.intervals import wilson_clusters
from albot_core.evaluation.trajectory import align
from albot_core.files import write_text
from albot_core.geometry.poses import compose, relative
from albot_core.geometry.types import Pose, Poses
from albot_core.localisation.config import LocaliserConfig
from albot_core.localisation.evidence import weigh_poses
from albot_core.localisation.known_map import KnownMap
from albot_core.localisation.localiser import LOCALISED, Localiser
from albot_core.localisation.mapper import known_map_of
from albot_core.localisation.search import search_map
from albot_core.logs.log import Log
from albot_core.mappers.mapper import CorrectedTrajectory
from albot_core.mappers.registry import make_mapper
from albot_core.matching.scan_points import matched_points
from albot_core.sensing.reading import LaserScan, Reading
from albot_env.recording.log import read_log_or_episode
from albot_env.sim.simulator import Simulator, follow_leg
from albot_env.tasks.place_recognition.tours import StoppingRooms
from albot_maps import World, load_world
from albot_maps.geodesic import DistanceField

MAPPERS = "albot1", "scan-matching", "graph-slam", "gmapping"
WAY, RIGHT = 10.0, 0.5
"""Length of a drive (m); a believed pose is right up to this error (m)."""
LOOKS_AROUND = 8
"""Readings of a turn on the spot in each room, when the map is made."""
CONFIG = LocaliserConfig()
HASTY = replace(CONFIG, elsewhere=1e-3, new_walls=1, certain=0.5, share=0.0, worst_share=0.0)
"""The method without the second look: the likeliest hypothesis is believed at once."""
METHODS = ("hypotheses", "hasty", "first match", "particles", "elsewhere")
_PARTICLES = 5000
_NOISE = (0.1, 0.1, math.radians(8.0))
"""Deviations of the particles' motion, as shares of a step of a metre and a radian."""
Drive = list[tuple[Reading, Pose, float]]
"""Readings, true poses in the map's frame, and path lengths (m)."""


class Tracked:
    """Baseline: the best pose of the first scan is believed, and followed."""

    def __init__(self, known: KnownMap) -> None:
        self._localiser = Localiser(known, CONFIG)
        self._known, self._begun = known, False

    def update(self, scan: LaserScan, motion: Pose) -> None:
        """Process a scan."""
        if not self._begun:
            points, _ = matched_points(scan, CONFIG.search_reach, CONFIG.evidence.spacing)
            apart = CONFIG.apart, CONFIG.apart_turn
            found, _ = search_map(self._known, points, CONFIG.heading_step, 0.0, 1, apart)
            self._localiser.believe(found[0] if len(found) else np.zeros(3))
            self._begun = True
            return
        self._localiser.update(scan, motion)

    @property
    def believed(self) -> Pose:
        """The pose."""
        return self._localiser.pose


class ParticleFilter:
    """Baseline: Monte Carlo localisation; its mean is believed once most particles agree."""

    def __init__(self, known: KnownMap, rng: np.random.Generator) -> None:
        self._known, self._rng = known, rng
        rows, columns = np.nonzero(known.is_open)
        chosen = rng.integers(len(rows), size=_PARTICLES)
        cells = np.stack((columns[chosen], rows[chosen]), axis=-1)
        inside = rng.random((_PARTICLES, 2))
        points = known.coarse.corner + (cells + inside) * known.coarse.config.cell
        self._poses: Poses = np.column_stack((points, rng.uniform(-np.pi, np.pi, _PARTICLES)))
        self._moved = math.inf

    def update(self, scan: LaserScan, motion: Pose) -> None:
        """Move, weigh and resample the particles (low variance; Thrun et al. 2005, table 4.4)."""
        step = math.hypot(motion[0], motion[1]) + abs(float(motion[2]))
        noise = self._rng.normal(0.0, 1.0, self._poses.shape) * _NOISE * (step + 0.02)
        self._poses = compose(self._poses, motion + noise)
        config = CONFIG.evidence
        points, _ = matched_points(scan, config.reach, config.spacing)
        eye = np.array(scan.geometry.mount[:2])
        logs, _ = weigh_poses(self._known.ground, self._poses, points, eye, config)
        weights = np.exp(logs - logs.max())
        at = (self._rng.random() + np.arange(_PARTICLES)) / _PARTICLES
        self._poses = self._poses[np.searchsorted(np.cumsum(weights) / weights.sum(), at[:-1])]
        self._poses = np.concatenate((self._poses, self._poses[-1:]))

    @property
    def believed(self) -> Pose | None:
        """The particles' median, if nine tenths of them are within half a metre of it."""
        middle: Pose = np.median(self._poses, axis=0)
        near = np.hypot(*(self._poses - middle)[:, :2].T) < RIGHT
        return middle if near.mean() > 0.9 else None


class Hypotheses:
    """The method itself, by a config."""

    def __init__(self, known: KnownMap, config: LocaliserConfig) -> None:
        self._localiser = Localiser(known, config)

    def update(self, scan: LaserScan, motion: Pose) -> None:
        """Process a scan."""
        self._localiser.update(scan, motion)

    @property
    def believed(self) -> Pose | None:
        """The pose, if one is believed."""
        return self._localiser.pose if self._localiser.standing == LOCALISED else None


@dataclass(frozen=True, kw_only=True)
class SavedMap:
    """A map, and where its mapper believed to be when it surveyed the world."""

    known: KnownMap
    true: Poses
    """True poses at the survey's readings, in the frame of the survey's start."""
    believed: Poses
    """The mapper's poses then, as believed at the end."""

    def place_of(self, pose: Pose) -> Pose:
        """Return where the map has a true pose: by the nearest reading of the survey."""
        nearest = int(np.argmin(np.hypot(*(self.true - pose)[:, :2].T)))
        return compose(self.believed[nearest], relative(self.true[nearest], pose))


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of one robot."""

    world: str
    mapper: str
    method: str
    right: bool
    """Whether it believes a right pose at the end."""
    wrong: bool
    """Whether it believes a wrong one at the end."""
    ever_wrong: bool
    """Whether it believed a wrong one at any reading."""
    after: float | None
    """Distance after which it first believed any (m)."""


def survey(simulator: Simulator, rng: np.random.Generator) -> Iterator[Reading]:
    """Yield the readings of a robot that is led into each room, the nearest next."""
    world = simulator.world
    stops = StoppingRooms(world)
    yield simulator.reset(rng, world.starts[0])
    goals = [stops.point(room, rng) for room in stops.rooms]
    while goals:
        away = [math.dist(goal, simulator.pose[:2]) for goal in goals]
        goal = goals.pop(int(np.argmin(away)))
        for point in _way(world, simulator.pose, goal):
            yield from follow_leg(simulator, point, STEPS)
        for _ in range(LOOKS_AROUND):
            yield simulator.turn(2 * math.pi / LOOKS_AROUND)


def _way(world: World, pose: Pose, goal: np.ndarray) -> np.ndarray:
    """Return a way to a point, with room beside the robot if there is any."""
    way = DistanceField(world.walls, world.robot_radius, goal, spare=0.1).path(pose[:2])
    if len(way):
        return way
    return DistanceField(world.walls, world.robot_radius, goal, tight=True).path(pose[:2])


def drive(world: World, rng: np.random.Generator) -> Drive:
    """Lead a robot from a random pose in a random room, for `WAY` metres."""
    simulator, stops = Simulator(world, movables=False), StoppingRooms(world)
    room = int(rng.choice(stops.rooms))
    start = np.array((*stops.point(room, rng), rng.uniform(-np.pi, np.pi)))
    found: Drive = []
    for reading in patrol(simulator, rng, start):
        way = found[-1][2] + math.hypot(*reading.motion[:2]) if found else 0.0
        found.append((reading, relative(world.starts[0], simulator.pose), way))
        if way >= WAY:
            return found
    return found


def map_of(name: str, readings: Sequence[Reading], true: Poses) -> SavedMap:
    """Return a mapper's map of a survey."""
    mapper, online = make_mapper(name), []
    for reading in readings:
        mapper.update(reading)
        online.append(mapper.estimate.pose)
    believed = np.array(online)
    if isinstance(mapper, CorrectedTrajectory):
        believed = mapper.corrected_poses()
    return SavedMap(known=known_map_of(mapper, CONFIG, name), true=true, believed=believed)


def follow(made: Any, drive: Drive, place_of: Callable[[Pose], Pose]) -> dict[str, Any]:
    """Let one method follow a drive; return what an `Outcome` says of it."""
    after, errors = None, []
    for reading, pose, way in drive:
        made.update(reading.required_laser("localisation"), reading.motion)
        if (believed := made.believed) is None:
            errors.append(math.nan)
            continue
        after = way if after is None else after
        errors.append(math.dist(believed[:2], place_of(pose)[:2]))
    last, wrong = errors[-1], [error > RIGHT for error in errors]
    return {"right": last <= RIGHT, "wrong": last > RIGHT, "ever_wrong": any(wrong), "after": after}


def _made(method: str, known: KnownMap, rng: np.random.Generator) -> Any:
    if method == "first match":
        return Tracked(known)
    if method == "particles":
        return ParticleFilter(known, rng)
    return Hypotheses(known, HASTY if method == "hasty" else CONFIG)


def _nowhere(pose: Pose) -> Pose:
    """Return where the map of another building has a pose: nowhere, so any claim is wrong."""
    return np.full_like(pose, math.inf)


def measure_world(
    spec: str, seed: int, starts: int, mappers: Sequence[str], methods: Sequence[str],
    other: SavedMap | None = None,
) -> tuple[list[Outcome], SavedMap]:  # fmt: skip
    """Map a world by each mapper, and let robots localise themselves in the maps.

    The baselines run on the first mapper's maps; `other` is a map of another building.

    Returns:
        The outcomes, and the first mapper's map.
    """
    world = load_world(spec)
    simulator = Simulator(world, movables=False)
    readings, true = [], []
    for reading in survey(simulator, np.random.default_rng(seed)):
        readings.append(reading)
        true.append(relative(world.starts[0], simulator.pose))
    maps = {name: map_of(name, readings, np.array(true)) for name in mappers}
    outcomes = []
    for number in range(starts):
        found = drive(world, np.random.default_rng((seed, number)))
        for name, saved in maps.items():
            for method in methods if name == mappers[0] else methods[:1]:
                rng = np.random.default_rng((seed, number, METHODS.index(method)))
                using, place_of = saved, saved.place_of
                if method == "elsewhere":
                    if other is None:
                        continue
                    using, place_of = other, _nowhere
                became = follow(_made(method, using.known, rng), found, place_of)
                outcomes.append(Outcome(world=spec, mapper=name, method=method, **became))
    return outcomes, maps[mappers[0]]


def measure_log(name: str, path: Path, mapper: str, second: Path | None) -> dict[str, Any]:
    """Map the first half of a log, or a whole one, and localise the second in that map.

    Where the log has a reference, the error is that of the believed positions in the frame in which
    the map's positions fit the reference best.
    """
    log = read_log_or_episode(path, True, None)
    half = len(log.readings) // 2 if second is None else len(log.readings)
    made, poses = make_mapper(mapper), []
    for reading in log.readings[:half]:
        made.update(reading)
        poses.append(made.estimate.pose)
    if isinstance(made, CorrectedTrajectory):
        poses = list(made.corrected_poses())
    other = log if second is None else read_log_or_episode(second, True, None)
    numbers = range(half, len(other.readings)) if second is None else range(len(other.readings))
    localiser = Localiser(known_map_of(made, CONFIG, path), CONFIG)
    to_map = _frame(log, np.array(poses), half) if second is None else None
    truth = None if to_map is None else _reference(log)
    rows: list[tuple[bool, float, float]] = []
    way = 0.0
    for number in numbers:
        reading = other.readings[number]
        way += math.hypot(*reading.motion[:2]) if rows else 0.0
        localiser.update(reading.required_laser(name), reading.motion)
        error = math.nan
        if to_map is not None and truth is not None:
            error = math.dist(localiser.pose[:2], compose(to_map, truth[number])[:2])
        rows.append((localiser.standing == LOCALISED, error, way))
    sure = np.array([row[0] for row in rows])
    errors = np.array([row[1] for row in rows])[sure]
    return {
        "log": name,
        "mapper": mapper,
        "scans": len(rows),
        "localised_share": float(sure.mean()),
        "localised_after_m": rows[int(np.argmax(sure))][2] if sure.any() else None,
        "losses": int((sure[:-1] & ~sure[1:]).sum()),
        "error_median_m": float(np.median(errors)) if len(errors) and truth is not None else None,
        "within_half_metre": (
            float((errors <= RIGHT).mean()) if len(errors) and truth is not None else None
        ),
        "within_one_metre": (
            float((errors <= 2 * RIGHT).mean()) if len(errors) and truth is not None else None
        ),
    }


def _reference(log: Log) -> Poses | None:
    """Return the reference pose of each scan; None if the log has none for each."""
    known = log.reference_trajectory
    return None if known is None or len(known.poses) != len(log.readings) else known.poses


def _frame(log: Log, poses: Poses, half: int) -> Pose | None:
    """Return the pose of the reference's frame on the map, by the part that was mapped."""
    truth = _reference(log)
    if truth is None:
        return None
    return align(truth[:half, :2], poses[:, :2])


LOGS = {
    "Wean 2 in the map of Wean 1": ("wean_robotdata1.log.xz", "wean_robotdata2.log.xz"),
    "Wean 1 in the map of Wean 2": ("wean_robotdata2.log.xz", "wean_robotdata1.log.xz"),
    "Intel, second half in the first's": ("intel_raw.json.gz", None),
    "ACES, second half in the first's": ("aces-corrected.log.gz", None),
    "Freiburg, second half in the first's": ("freiburg-101-corrected.log.gz", None),
}
"""The drives that are localised, and the files of `ALBOT_DATA/logs` they need."""


def counts(outcomes: Sequence[Outcome]) -> list[dict[str, Any]]:
    """Return a row for each method and mapper."""
    rows = []
    for method, mapper in dict.fromkeys((each.method, each.mapper) for each in outcomes):
        some = [each for each in outcomes if (each.method, each.mapper) == (method, mapper)]
        worlds = [each.world for each in some]
        row: dict[str, Any] = {"method": method, "mapper": mapper, "starts": len(some)}
        for name in ("right", "wrong", "ever_wrong"):
            which = np.array([getattr(each, name) for each in some])
            row[name] = int(which.sum())
            row[f"{name}_ci95"] = wilson_clusters(which, worlds)
        known = [each.after for each in some if each.after is not None]
        row["median_after_m"] = float(np.median(known)) if known else None
        rows.append(row)
    return rows


def rows_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows of `counts` as a Markdown table."""
    lines = [
        "| method | map of | starts | right | sure and wrong | ever sure and wrong | sure after |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        shares = " | ".join(
            f"{row[name] / row['starts']:.1%} ({row[f'{name}_ci95'][0]:.1%} to "
            f"{row[f'{name}_ci95'][1]:.1%})"
            for name in ("right", "wrong", "ever_wrong")
        )
        after = row["median_after_m"]
        after = "never" if after is None else f"{after:.1f} m"
        lines.append(
            f"| {row['method']} | {row['mapper']} | {row['starts']} | {shares} | {after} |"
        )
    return "\n".join(lines)


def logs_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return rows of `measure_log` as a Markdown table."""
    lines = [
        "| drive | map of | scans | localised after | at | losses | median error | within 1 m |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        after, error = row["localised_after_m"], row["error_median_m"]
        near = row["within_one_metre"]
        lines.append(
            f"| {row['log']} | {row['mapper']} | {row['scans']} | "
            f"{'never' if after is None else f'{after:.1f} m'} | {row['localised_share']:.0%} | "
            f"{row['losses']} | {'no reference' if error is None else f'{error:.2f} m'} | "
            f"{'–' if near is None else f'{near:.0%}'} |"
        )
    return "\n".join(lines)


@click.command()
@click.option("--worlds", default="random:office:SEED?rooms=8", show_default=True)
@click.option("--seeds", default="70000..70049", show_default=True)
@click.option("--world", "named", multiple=True, help="A world instead; may be repeated.")
@click.option(
    "--starts",
    default=4,
    show_default=True,
    type=CountType(1),
    help="Robots in each world.",
)
@click.option("--mapper", "mappers", multiple=True, default=MAPPERS, show_default=True)
@click.option("--baselines", is_flag=True, help="Also the baselines, on the first mapper's maps.")
@click.option("--logs", type=PathType(), help="Folder of the logs; then these are localised.")
@click.option("--out", type=PathType(), help="File for the figures, as JSON.")
@JSON
def command(
    worlds: str,
    seeds: str,
    named: tuple[str, ...],
    starts: int,
    mappers: tuple[str, ...],
    baselines: bool,
    logs: Path | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Let robots localise themselves in saved maps, and count who is right."""
    found: dict[str, Any]
    if logs is not None:
        found = {"rows": _measure_logs(logs, mappers, out)}
        text = logs_table(found["rows"])
    else:
        specs = list(named) or [worlds.replace("SEED", str(seed)) for seed in parse_seeds(seeds)]
        methods = METHODS if baselines else METHODS[:1]
        outcomes: list[Outcome] = []
        other: SavedMap | None = None
        with progress("saved maps", len(specs), "worlds") as update:
            for number, spec in enumerate(specs):
                done, other = measure_world(spec, number, starts, mappers, methods, other)
                outcomes += done
                found = {"worlds": specs[: number + 1], "rows": counts(outcomes)}
                found["outcomes"] = [asdict(outcome) for outcome in outcomes]
                _write(out, found)
                update(number + 1)
        text = rows_table(found["rows"])
    click.echo(json.dumps(found) if as_json else text)


def _write(out: Path | None, found: dict[str, Any]) -> None:
    """Write the figures so far, so that a study that is stopped keeps what it has measured."""
    if out is not None:
        write_text(out, json.dumps(found, indent=1) + "\n")


def _measure_logs(folder: Path, mappers: Sequence[str], out: Path | None) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    with progress("saved maps", len(LOGS) * len(mappers), "drives") as update:
        for name, (first, second) in LOGS.items():
            for mapper in mappers:
                other = None if second is None else folder / second
                rows.append(measure_log(name, folder / first, mapper, other))
                _write(out, {"rows": rows})
                update(len(rows))
    return rows
