"""The mapping systems by name."""

from __future__ import annotations

import importlib
from collections.abc import Collection, Mapping
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, get_args

import numpy as np

from albot_core.errors import InputError, did_you_mean
from albot_core.mappers.looped import LoopedMappers
from albot_core.mappers.mapper import Mapper, MapperBatch, MapperSpec
from albot_core.mappers.result_checks import check_array
from albot_core.maps.layers import LAYERS
from albot_core.plain_data import Location, check_types, read_config
from albot_core.ranges import FROM_ONE
from albot_core.sensing.reading import Sensor

_HOSSAIN = "Hossain, How Albot1 computes its perceptual map, PhD thesis, AUT 2014"
_YEAP = "Yeap and others, Autonomous robot mapping by landmark association, 2015"
_MILFORD = "Milford, Prasser and Wyeth, Experience mapping, ACRA 2005"
_SCHMIDT = "Schmidt, Wong and Yeap, Mapping and localisation with sonar ASRs (Albot0)"
_THRUN = "Thrun, Burgard and Fox, A real-time algorithm for mobile robot mapping, ICRA 2000"
_HAEHNEL = "Hähnel, Burgard, Fox and Thrun, An efficient FastSLAM algorithm, IROS 2003"
_MONTEMERLO = "Montemerlo, Thrun, Koller and Wegbreit, FastSLAM 2.0, IJCAI 2003"
_GRISETTI = "Grisetti, Stachniss and Burgard, Improved techniques for grid mapping, T-RO 2007"
_KUEMMERLE = "Grisetti, Kümmerle and others, A tutorial on graph-based SLAM, IEEE ITS 2010"
_KONOLIGE = "Konolige and others, Efficient sparse pose adjustment for 2D mapping, IROS 2010"
_ELIAZAR = "Eliazar and Parr, DP-SLAM, IJCAI 2003, and DP-SLAM 2.0, ICRA 2004"
_LAMBRINOS = "Lambrinos and others, A mobile robot employing insect strategies, RAS 2000"
_BEESON = "Beeson, Modayil and Kuipers, Factoring the mapping problem (HSSH), IJRR 2010"
_LASER: frozenset[Sensor] = frozenset({"laser"})
_ARRAYS: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
    "poses": (np.float64, (3,)),
    "homes_in_map": (np.float64, (3,)),
    "is_recognised": (np.bool_, ()),
    "is_lost": (np.bool_, ()),
    "matched_readings": (np.int64, ()),
    "ways_home": (np.float64, (7,)),
}
"""Type, and shape per robot, of a batch's arrays. Compiled code reads them by their address, so a
wrong shape or type is worse than a wrong number."""
_MEMBERS = {
    kind.__name__: tuple(name for name in vars(kind) if not name.startswith("_"))
    for kind in (Mapper, MapperBatch)
}
"""The properties and methods that every mapper and every batch has, by protocol."""

NO_MAPPER = "none"
"""Name for no mapper: the belief is dead reckoning, and there is no map."""

MAPPERS: dict[str, MapperSpec] = {
    spec.name: spec
    for spec in (
        MapperSpec(
            name="albot0",
            summary="Albot0's local spaces (ASRs) by eight sonars, and the way home by them.",
            paper=_SCHMIDT,
            sensors=frozenset({"sonar"}),
            layers=("segments", "place_graph"),
            factory="albot_core.mappers.albot0.mapper:Albot0",
            config="albot_core.mappers.albot0.config:Albot0Config",
        ),
        MapperSpec(
            name="albot0-paper",
            summary="Albot0 to the letter: distance and orientation, whatever the frame.",
            paper=_SCHMIDT,
            sensors=frozenset({"sonar"}),
            layers=("segments", "place_graph"),
            factory="albot_core.mappers.albot0.mapper:Albot0",
            config="albot_core.mappers.albot0.config:Albot0Config.paper",
        ),
        MapperSpec(
            name="albot1",
            summary="Albot1's perceptual map, with our recognition and localisation.",
            paper=_HOSSAIN,
            sensors=_LASER,
            layers=("segments", "place_graph"),
            has_exits=True,
            has_matches=True,
            factory="albot_core.mappers.albot1.mapper:Albot1",
            config="albot_core.mappers.albot1.config:Albot1Config",
            batch="albot_core.mappers.albot1.batch:Albot1Batch",
        ),
        MapperSpec(
            name="albot1-thesis",
            summary="Albot1's perceptual map to the letter of the thesis (algorithms 1 to 4).",
            paper=_HOSSAIN,
            sensors=_LASER,
            layers=("segments", "place_graph"),
            has_exits=True,
            has_matches=True,
            factory="albot_core.mappers.albot1.mapper:Albot1",
            config="albot_core.mappers.albot1.config:Albot1Config.thesis",
            batch="albot_core.mappers.albot1.batch:Albot1Batch",
        ),
        MapperSpec(
            name="albot1-tracked",
            summary="Albot1 by several landmarks tracked from view to view; no match with the map.",
            paper=_HOSSAIN,
            sensors=_LASER,
            layers=("segments", "place_graph"),
            has_exits=True,
            has_matches=True,
            factory="albot_core.mappers.albot1.mapper:Albot1",
            config="albot_core.mappers.albot1.config:Albot1Config.tracked",
            batch="albot_core.mappers.albot1.batch:Albot1Batch",
        ),
        MapperSpec(
            name="association",
            summary="Scans matched by landmarks: a map of surfaces, each put in by those near it.",
            paper=_YEAP,
            sensors=_LASER,
            layers=("segments",),
            factory="albot_core.mappers.association.mapper:Association",
            config="albot_core.mappers.association.mapper:AssociationConfig",
        ),
        MapperSpec(
            name="association-paper",
            summary="Landmark association to the letter: each surface by its nearest landmark.",
            paper=_YEAP,
            sensors=_LASER,
            layers=("segments",),
            factory="albot_core.mappers.association.paper:AssociationPaper",
            config="albot_core.mappers.association.mapper:LandmarkConfig",
        ),
        MapperSpec(
            name="dp-slam",
            summary="Particles that share one grid, whose squares know the ancestor that saw them.",
            paper=_ELIAZAR,
            sensors=_LASER,
            layers=("occupancy_grid", "trajectory", "particles"),
            factory="albot_core.mappers.slam.dp_slam:DpSlam",
            config="albot_core.mappers.slam.dp_slam_config:DpSlamConfig",
        ),
        MapperSpec(
            name="fastslam",
            summary="FastSLAM with landmarks: particles with a Kalman filter for each corner.",
            paper=_MONTEMERLO,
            sensors=_LASER,
            layers=("occupancy_grid", "trajectory", "particles"),
            factory="albot_core.mappers.slam.fastslam:FastSlam",
            config="albot_core.mappers.slam.fastslam_config:FastSlamConfig",
        ),
        MapperSpec(
            name="gmapping",
            summary="GMapping: grids by particles, drawn where motion and scan agree.",
            paper=_GRISETTI,
            sensors=_LASER,
            layers=("occupancy_grid", "trajectory", "particles"),
            factory="albot_core.mappers.slam.gmapping:GMapping",
            config="albot_core.mappers.slam.gmapping:GMappingConfig",
        ),
        MapperSpec(
            name="graph-slam",
            summary="Keyframes and loop closures, verified, and their optimum by GTSAM.",
            paper=_KUEMMERLE,
            sensors=_LASER,
            layers=("occupancy_grid", "place_graph", "trajectory"),
            has_matches=True,
            factory="albot_core.mappers.slam.graph_slam:GraphSlam",
            config="albot_core.mappers.slam.graph_slam_config:GraphSlamConfig",
            extra="slam",
            modules=("gtsam",),
        ),
        MapperSpec(
            name="grid-slam",
            summary="Grid-based FastSLAM: particles move by matched scans, each with a grid.",
            paper=_HAEHNEL,
            sensors=_LASER,
            layers=("occupancy_grid", "trajectory", "particles"),
            factory="albot_core.mappers.slam.grid_slam:GridSlam",
            config="albot_core.mappers.slam.grid_slam:GridSlamConfig",
        ),
        MapperSpec(
            name="hssh",
            summary="Local maps, their gateways, and the tree of all topological maps that agree.",
            paper=_BEESON,
            sensors=_LASER,
            layers=("occupancy_grid", "place_graph"),
            factory="albot_core.mappers.hssh.mapper:Hssh",
            config="albot_core.mappers.hssh.config:HsshConfig",
            has_exits=True,
        ),
        MapperSpec(
            name="karto",
            summary="OpenKarto as packaged for Python: a yardstick that none of us wrote.",
            paper=_KONOLIGE,
            sensors=_LASER,
            layers=("occupancy_grid", "trajectory"),
            factory="albot_core.mappers.slam.karto:Karto",
            config="albot_core.mappers.slam.karto:KartoConfig",
            extra="peers",
            modules=("yag_slam", "karto_scanmatcher", "cv2"),
        ),
        MapperSpec(
            name="odometry",
            summary="Every view laid down where the odometer says: what the others must better.",
            paper=f"{_HOSSAIN}, chapter 3",
            sensors=_LASER,
            layers=("segments",),
            factory="albot_core.mappers.odometry.mapper:OdometryMapper",
            config="albot_core.mappers.odometry.batch:OdometryConfig",
            batch="albot_core.mappers.odometry.batch:OdometryBatch",
        ),
        MapperSpec(
            name="ratslam",
            summary="RatSLAM's pose cells and experience map, which sees by laser panoramas.",
            paper=_MILFORD,
            sensors=_LASER,
            layers=("place_graph", "trajectory"),
            has_matches=True,
            factory="albot_core.mappers.ratslam.mapper:RatSlam",
            config="albot_core.mappers.ratslam.config:RatSlamConfig",
        ),
        MapperSpec(
            name="ratslam-paper",
            summary="RatSLAM to the letter, by numbers of scenes: each match counts at once.",
            paper=_MILFORD,
            # The paper's views are a camera's; a laser it does not cover.
            sensors=frozenset({"scene"}),
            layers=("place_graph", "trajectory"),
            has_matches=True,
            factory="albot_core.mappers.ratslam.mapper:RatSlam",
            config="albot_core.mappers.ratslam.config:RatSlamConfig.paper",
        ),
        MapperSpec(
            name="ratslam-scenes",
            summary="`ratslam` with the numbers of visual scenes, as in the paper's simulator.",
            paper=_MILFORD,
            sensors=frozenset({"scene"}),
            layers=("place_graph", "trajectory"),
            has_matches=True,
            factory="albot_core.mappers.ratslam.mapper:RatSlam",
            config="albot_core.mappers.ratslam.config:RatSlamConfig.scenes",
        ),
        MapperSpec(
            name="sahabot",
            summary="Sahabot 2: an ant's home vector by compass, and the nest by its landmarks.",
            paper=_LAMBRINOS,
            sensors=frozenset({"laser", "compass"}),
            layers=("place_graph",),
            factory="albot_core.mappers.sahabot.mapper:Sahabot",
            config="albot_core.mappers.sahabot.config:SahabotConfig",
        ),
        MapperSpec(
            name="sahabot-wheels",
            summary="`sahabot` without its compass: the wheels alone tell the heading.",
            paper=_LAMBRINOS,
            sensors=_LASER,
            layers=("place_graph",),
            factory="albot_core.mappers.sahabot.mapper:Sahabot",
            config="albot_core.mappers.sahabot.config:SahabotConfig.wheels",
        ),
        MapperSpec(
            name="scan-matching",
            summary="Incremental scan matching: each scan where it fits the latest ones best.",
            paper=_THRUN,
            sensors=_LASER,
            layers=("occupancy_grid", "trajectory"),
            factory="albot_core.mappers.slam.scan_matching:ScanMatching",
            config="albot_core.mappers.slam.scan_matching:ScanMatchingConfig",
        ),
    )
}
"""All mapping systems by name, in alphabetical order."""


def register_mapper(spec: MapperSpec) -> None:
    """Register a mapping system under its name.

    Raises:
        InputError: Another mapper has this name, or there is no such sensor or layer.
    """
    for field, names, known in (
        ("sensors", spec.sensors, get_args(Sensor)),
        ("layers", spec.layers, tuple(LAYERS)),
    ):
        for name in set(names).difference(known):
            found = f"{name}{did_you_mean(name, known)}"
            expected = f"only {', '.join(known)}"
            raise InputError(f"mapper {spec.name}", expected, found, place=field)
    if MAPPERS.setdefault(spec.name, spec) != spec:
        raise InputError("register_mapper", "a name that no other mapper has", repr(spec.name))


def mapper_names() -> tuple[str, ...]:
    """Return the names of all registered mapping systems."""
    return tuple(MAPPERS)


def mapper_spec(name: str) -> MapperSpec:
    """Return the spec of a mapping system.

    Args:
        name: Its name; or, as in gymnasium, `module:name`, where `module` is imported first and
            registers the mapper.

    Raises:
        InputError: The module or the mapper is unknown; the message suggests the closest name.
    """
    module, colon, last = str(name).rpartition(":")
    if colon:
        try:
            importlib.import_module(module)
        except InputError:  # The module's own.
            raise
        except (ImportError, SyntaxError, TypeError, ValueError) as error:
            # For an empty or a relative name importlib raises the last two.
            expected = "a module that can be imported before the colon"
            raise InputError("mapper", expected, f"{name!r} ({error})") from None
    spec = MAPPERS.get(last)
    if spec is None:
        found = f"{last!r}{did_you_mean(last, MAPPERS)}"
        raise InputError("mapper", f"one of {', '.join(MAPPERS)}", found)
    return spec


def installed_mappers() -> tuple[str, ...]:
    """Return the names of the mapping systems whose extras are installed."""
    return tuple(name for name, spec in MAPPERS.items() if not _missing(spec))


def check_installed(spec: MapperSpec) -> None:
    """Check that the extra that a mapper needs is installed.

    Raises:
        InputError: A module is missing; the message names the extra.
    """
    missing = _missing(spec)
    if missing:
        where = f"in a clone of the project: pip install -c constraints.txt '.[{spec.extra}]'"
        expected = f"what the extra `{spec.extra}` brings ({where})"
        raise InputError(f"mapper {spec.name}", expected, f"no {', '.join(missing)}")


def _missing(spec: MapperSpec) -> list[str]:
    return [module for module in spec.modules if find_spec(module) is None]


def check_sensors(spec: MapperSpec, available: Collection[Sensor], source: object) -> None:
    """Check that the sensors that a mapper needs are available.

    Args:
        spec: The mapper.
        available: The available sensors.
        source: Owner of these sensors, for the error: an environment or a log.

    Raises:
        InputError: A sensor is missing; the message names it.
    """
    missing = sorted(spec.sensors - set(available))
    if missing:
        expected = f"a mapper that needs no more than {', '.join(sorted(available)) or 'odometry'}"
        found = f"{spec.name}, which needs {', '.join(missing)}"
        raise InputError(source, expected, found, place="mapper")


def make_mapper(
    name: str,
    *,
    config: Any = None,
    rng: np.random.Generator | None = None,
    map: str | Path | None = None,  # noqa: A002
    localise: bool = False,
    extend: bool = False,
) -> Mapper:
    """Make a mapper: a fresh one, or one that goes on in a saved map.

    Args:
        name: See `mapper_spec`.
        config: Its parameters: an instance of its config class, or a mapping of the values that
            differ from the defaults. With a map, the map's own, or None.
        rng: Source of its random numbers; by default a generator of seed 0.
        map: A file of `save_map`, of this mapper. Without `localise` the mapper goes on as if it
            had never stopped.
        localise: Whether the robot may be anywhere on the map: it localises itself first (see
            `albot_core.localisation`).
        extend: Whether a robot that has localised itself goes on mapping; otherwise its map is
            frozen.

    Raises:
        InputError: The mapper is unknown, the config is not of its class, an extra that the mapper
            needs is not installed, or what its factory makes is no mapper; or the map is not valid,
            or is of another mapper or config, or has no walls.
    """
    if map is not None or localise or extend:
        from albot_core.localisation.saved_maps import mapper_in_map  # it loads mappers itself

        return mapper_in_map(name, map, config=config, localise=localise, extend=extend)
    spec = mapper_spec(name)
    check_installed(spec)
    mapper: Mapper = _load(spec, "factory")(config=mapper_config(spec, config), name=spec.name)
    _check_members(mapper, "Mapper", spec, "factory")
    if rng is not None:
        mapper.reset(rng)
    return mapper


def make_mappers(
    name: str,
    count: int,
    *,
    config: Any = None,
    map: str | Path | None = None,  # noqa: A002
    extend: bool = False,
) -> MapperBatch:
    """Make a batch of mappers of one kind, one per robot: fresh, or each localising in a map.

    What a batch from outside the project gives is checked at every call.

    Args:
        name: See `mapper_spec`.
        count: Number of robots.
        config: See `make_mapper`.
        map: A file of `save_map`, in which each robot localises itself; None for fresh mappers.
        extend: See `make_mapper`.

    Raises:
        InputError: As for `make_mapper`; or the count is not a whole number from 1, or the batch
            is not as `MapperBatch` says.
    """
    spec = mapper_spec(name)
    if count not in FROM_ONE:
        raise InputError("make_mappers, count", FROM_ONE.expected, str(count))
    if map is not None:
        return LoopedMappers(
            [
                make_mapper(name, config=config, map=map, localise=True, extend=extend)
                for _ in range(count)
            ]
        )
    config = mapper_config(spec, config)
    if spec.batch is None:
        return LoopedMappers([make_mapper(name, config=config) for _ in range(count)])
    mappers: MapperBatch = _load(spec, "batch")(count, config=config, name=spec.name)
    if spec.batch.startswith("albot_core."):  # Our own are checked by the tests.
        return mappers
    _check_members(mappers, "MapperBatch", spec, "batch")
    for name, (kind, shape) in _ARRAYS.items():
        check_array(getattr(mappers, name), name, kind, (count, *shape), spec)
    return mappers


def _check_members(made: object, protocol: str, spec: MapperSpec, field: str) -> None:
    """Raise InputError unless what a field of the spec has made has the protocol's members."""
    members = _MEMBERS[protocol]
    # Of the class, because a property of the object is costly.
    known = {*dir(type(made)), *getattr(made, "__dict__", ())}
    if missing := [member for member in members if member not in known]:
        expected = f"the members of {protocol}: {', '.join(members)}"
        found = f"{type(made).__name__} without {', '.join(missing)}"
        raise InputError(f"mapper {spec.name}", expected, found, place=field)


def mapper_config(spec: MapperSpec, config: Any = None, where: Location | None = None) -> Any:
    """Return the config that a mapper gets.

    Args:
        spec: The mapper.
        where: Location of the config, for errors.
        config: An instance of its config class; or a mapping, as read from YAML, of the values that
            differ from the defaults; or None for the defaults.

    Raises:
        InputError: The config is of another class, or the mapping holds an unknown key or an
            invalid value; the message names it.
    """
    default = _load(spec, "config")()
    if config is None:
        return default
    where = Location(f"mapper {spec.name}, config") if where is None else where
    if isinstance(config, Mapping):
        return read_config(type(default), config, where, default)
    if not isinstance(config, type(default)):
        raise InputError(where.source, f"a mapping or {type(default).__name__}", repr(config))
    check_types(config)
    return config


def config_for_radius(config: Any, radius: float) -> Any:
    """Return a mapper's config with a robot's radius (m) as `way_home.robot_radius`, if it has it.

    A mapper that finds its way home over a grid asks how wide the robot is.
    """
    way_home: Any = getattr(config, "way_home", None)
    if not hasattr(way_home, "robot_radius"):
        return config
    return replace(config, way_home=replace(way_home, robot_radius=radius))


def _load(spec: MapperSpec, field: str) -> Any:
    """Import and return what a field of a spec names as `module:name`.

    Raises:
        InputError: The module has nothing of this name.
    """
    named = getattr(spec, field)
    module, _, path = named.partition(":")
    loaded: Any = importlib.import_module(module)
    for part in path.split("."):
        if not hasattr(loaded, part):
            found = f"{named}{did_you_mean(part, dir(loaded))}"
            raise InputError(f"mapper {spec.name}", "a name in its module", found, place=field)
        loaded = getattr(loaded, part)
    return loaded
