"""Load worlds, and sets of worlds, by their spec: the string that names a world everywhere.

A spec is a name from the catalogue, a file in any supported format, or a random building.
"""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from weakref import WeakValueDictionary

from albot_core.errors import InputError, MissingFileError, did_you_mean
from albot_core.files import exists
from albot_core.yaml_document import YamlDocument, read_yaml
from albot_maps.formats.world_file import check_schema, world_from_document
from albot_maps.generators.spec import PREFIX, parse_spec
from albot_maps.world import ROBOT_RADIUS, World

_CATALOGUE = resources.files("albot_maps") / "catalogue"
_YAML = {".yaml", ".yml"}
PICTURES = {".pgm", ".png", ".ppm", ".pbm", ".pnm", ".bmp", ".gif", ".jpg", ".jpeg"}
"""Suffixes of the pictures of ROS maps."""
KEPT = 256
"""Number of a set's most recently used worlds that stay in memory; others are loaded again."""

_RANDOM: WeakValueDictionary[tuple[str, float], World] = WeakValueDictionary()
"""The random worlds in use, by spec and radius. Who asks for one again gets the same object, and so
shares what is cached for it, such as the journeys in it."""
_MOST = 1_000_000_000
"""Largest number of random worlds in a set."""
_RANGE = re.compile(
    re.escape(PREFIX) + r"(?P<kind>[^:?]*):(?P<first>\d+)\.\.(?P<last>\d+)(?P<rest>\?.*)?"
)


def catalogue_names() -> tuple[str, ...]:
    """Return the names of the worlds that come with the project."""
    files = (entry.name for entry in _CATALOGUE.iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml")))


def load_world(spec: str | Path, robot_radius: float = ROBOT_RADIUS) -> World:
    """Return the world that a spec names: from the catalogue, from a file, or a random one.

    It is made and checked for a robot of this radius (m).

    A random world's spec is `random:KIND:SEED`, optionally followed by parameters:
    `random:office:42?rooms=12&clutter=0.3`.

    Raises:
        InputError: There is no such world, its file is invalid, it cannot be generated, or it is
            not valid for the robot: a door is too narrow, for example.
    """
    spec = str(spec)
    if spec.startswith(PREFIX):
        world = _RANDOM.get((spec, robot_radius))
        if world is None:
            world = _RANDOM[spec, robot_radius] = parse_spec(spec).make(robot_radius)
        return world
    names = catalogue_names()
    if spec in names:
        document = _catalogue_document(spec)
        return world_from_document(document, source=spec, robot_radius=robot_radius)
    path = Path(spec)
    if spec and (exists(path) or path.suffix or path.parent != Path()):
        return read_world(path, robot_radius)
    raise InputError(
        "world",
        f"a file, {PREFIX}KIND:SEED or one of {', '.join(names)}",
        f"{spec or 'nothing'}{did_you_mean(spec, names)}",
    )


@cache
def _catalogue_document(name: str) -> YamlDocument:
    """Return a catalogue world's document. It is read once: that takes longest, and it stays."""
    document = YamlDocument((_CATALOGUE / f"{name}.yaml").read_text(encoding="utf-8"), name)
    check_schema(document, name)
    return document


def read_world(path: Path, robot_radius: float = ROBOT_RADIUS) -> World:
    """Return the world in a file, for a robot of this radius (m). Its suffix selects the format.

    Formats are `albot-world` YAML, a ROS map (its YAML or its picture), a floor plan in XML, a
    HouseExpo house (JSON) and a Stage world. Any of them may be compressed (`.gz`, `.xz`).

    Raises:
        InputError: The file cannot be read, its format is unknown, or its content is invalid.
    """
    kind = Path(path.stem).suffix if path.suffix in {".gz", ".xz"} else path.suffix
    if kind in _YAML:
        return _read_yaml_world(path, robot_radius)
    # The readers of other formats are imported only when needed: they are slow to load.
    if kind == ".xml":
        from albot_maps.formats.plan_xml import read_plan_xml

        return read_plan_xml(path, robot_radius)
    if kind == ".json":
        from albot_maps.formats.house_json import read_house_json

        return read_house_json(path, robot_radius)
    if kind == ".world":
        from albot_maps.formats.stage_world import read_stage_world

        return read_stage_world(path, robot_radius)
    if kind in PICTURES:
        return _read_yaml_world(_description_of(path), robot_radius)
    if not exists(path):
        raise MissingFileError(path)
    from albot_core.file_kinds import kind_of  # Slow to load, and needed here alone.

    found = kind_of(path) or kind or "no suffix"
    raise InputError(
        path, "a world file: .yaml, .xml, .json, .world or a picture (.pgm, .png, …)", found
    )


def _read_yaml_world(path: Path, robot_radius: float) -> World:
    document = read_yaml(path)
    if isinstance(document.data, dict) and "image" in document.data:
        from albot_maps.formats.ros_grid import read_ros_grid

        return read_ros_grid(document, path, robot_radius)
    check_schema(document, str(path))
    return world_from_document(document, source=str(path), robot_radius=robot_radius)


def _description_of(picture: Path) -> Path:
    """Return the path of the YAML file beside a ROS map's picture."""
    if not exists(picture):
        raise MissingFileError(picture)
    stem = picture.name.split(".")[0]
    for suffix in sorted(_YAML):
        path = picture.with_name(picture.name.replace(".gz", "")).with_suffix(suffix)
        if path.is_file():
            return path
    raise InputError(picture, f"its map_server description {stem}.yaml in the same folder", "none")


class WorldSet:
    """Worlds by number. A world is loaded or generated when it is first accessed.

    Args:
        worlds: The worlds, or their specs.
        robot_radius: Radius (m) of the robot for which they are made and checked.

    Raises:
        InputError: `worlds` is empty, or the first one is invalid.
    """

    def __init__(
        self, worlds: Sequence[str | Path | World], robot_radius: float = ROBOT_RADIUS
    ) -> None:
        if not len(worlds):
            raise InputError("worlds", "at least one world", "none")
        self._worlds = worlds
        self._robot_radius = robot_radius
        self._loaded: OrderedDict[int, World] = OrderedDict()
        self[0]  # An invalid spec raises now, not during a training run.

    def for_robot(self, radius: float) -> WorldSet:
        """Return the same worlds for a robot of another radius (m); itself for the same radius.

        Raises:
            InputError: The first world is not valid for that robot.
        """
        return self if radius == self._robot_radius else WorldSet(self._worlds, radius)

    def __len__(self) -> int:
        """Return the number of worlds."""
        return len(self._worlds)

    def __iter__(self) -> Iterator[World]:
        """Iterate over the worlds in order."""
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> World:
        """Return a world by its number, from 0.

        Raises:
            InputError: No world has that number, or it is invalid.
        """
        if not 0 <= number < len(self):
            expected = f"a world's number below {len(self)}"
            raise InputError("worlds", expected, str(number))
        if number not in self._loaded:
            world = self._worlds[number]
            self._loaded[number] = (
                world.for_robot(self._robot_radius)
                if isinstance(world, World)
                else load_world(world, self._robot_radius)
            )
            if len(self._loaded) > KEPT:
                self._loaded.popitem(last=False)
        self._loaded.move_to_end(number)
        return self._loaded[number]


def load_worlds(
    spec: str | Path | World | WorldSet | list[str], robot_radius: float = ROBOT_RADIUS
) -> WorldSet:
    """Return the worlds that a spec names, for a robot of this radius (m).

    A spec with a range of seeds names one random world per seed: `random:office:0..99?rooms=8`
    names those of seeds 0 to 99. Any other spec names one world (see `load_world`). A list names
    the worlds of its specs, one each.

    Raises:
        InputError: As `load_world`; or the range is empty or too large, or `spec` has another type.
    """
    if isinstance(spec, WorldSet):
        return spec.for_robot(robot_radius)
    if isinstance(spec, list) and all(isinstance(each, str) for each in spec):
        return WorldSet(spec, robot_radius)
    if not isinstance(spec, str | Path | World):
        raise InputError("world", "a world, a set of worlds, or a spec of them", repr(spec))
    found = _RANGE.fullmatch(spec) if isinstance(spec, str) else None
    if found is None:
        return WorldSet((spec,), robot_radius)
    first, last = int(found["first"]), int(found["last"])
    parse_spec(f"{PREFIX}{found['kind']}:{last}{found['rest'] or ''}")
    if not 0 <= last - first < _MOST:
        expected = f"a range of seeds A..B with B at least A, of {_MOST:,} seeds at most"
        raise InputError(str(spec), expected, f"{first}..{last}")
    specs = _Specs(found["kind"], range(first, last + 1), found["rest"] or "")
    return WorldSet(specs, robot_radius)


def is_range(spec: str) -> bool:
    """Return whether a spec names a random world for each seed of a range."""
    return _RANGE.fullmatch(spec) is not None


class _Specs(Sequence[str]):
    """The specs of the random worlds for a range of seeds."""

    def __init__(self, kind: str, seeds: range, rest: str) -> None:
        self._kind, self._seeds, self._rest = kind, seeds, rest

    def __len__(self) -> int:
        return len(self._seeds)

    def __getitem__(self, number: int) -> str:  # type: ignore[override]
        return f"{PREFIX}{self._kind}:{self._seeds[number]}{self._rest}"
