"""Worlds by their spec, the one string that names a world everywhere, and sets of worlds.

A spec is the name of a world of the catalogue, a file of any format, or a random building.
"""

from __future__ import annotations

import re
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path

from albot_core.errors import InputError, MissingFileError, did_you_mean
from albot_core.files import exists
from albot_core.yaml_document import read_yaml
from albot_maps.formats.world_file import parse_world, world_from_document
from albot_maps.generators.spec import PREFIX, parse_spec
from albot_maps.world import World

_CATALOGUE = resources.files("albot_maps") / "catalogue"
_YAML = {".yaml", ".yml"}
_PICTURES = {".pgm", ".png"}
KEPT = 256
"""Worlds of a set that are kept once they were needed; others are made again."""

_MOST = 1_000_000_000
"""Largest set of random worlds."""
_RANGE = re.compile(
    re.escape(PREFIX) + r"(?P<kind>[^:?]*):(?P<first>\d+)\.\.(?P<last>\d+)(?P<rest>\?.*)?"
)


def catalogue_names() -> tuple[str, ...]:
    """The names of the worlds that come with the project."""
    files = (entry.name for entry in _CATALOGUE.iterdir())
    return tuple(sorted(name.removesuffix(".yaml") for name in files if name.endswith(".yaml")))


def load_world(spec: str | Path) -> World:
    """The world that a spec names: one of the catalogue's, a file's, or a random one.

    A random world's spec is `random:KIND:SEED`, followed where wanted by its parameters:
    `random:office:42?rooms=12&clutter=0.3`.

    Raises:
        InputError: There is no such world, its file is wrong, or no such world can be made.
    """
    spec = str(spec)
    if spec.startswith(PREFIX):
        return parse_spec(spec).make()
    names = catalogue_names()
    if spec in names:
        return parse_world((_CATALOGUE / f"{spec}.yaml").read_text(encoding="utf-8"), source=spec)
    path = Path(spec)
    if spec and (exists(path) or path.suffix or path.parent != Path()):
        return read_world(path)
    raise InputError(
        "world",
        f"a file, {PREFIX}KIND:SEED or one of {', '.join(names)}",
        f"{spec or 'nothing'}{did_you_mean(spec, names)}",
    )


def read_world(path: Path) -> World:
    """The world in a file: our own YAML or a foreign format, told by the file's ending.

    Foreign are a ROS map (its YAML or its picture), a plan's XML, a HouseExpo house (JSON)
    and a Stage world.

    Any of them may be compressed (`.gz`, `.xz`).

    Raises:
        InputError: The file cannot be read, its format is not known, or it is wrong.
    """
    kind = Path(path.stem).suffix if path.suffix in {".gz", ".xz"} else path.suffix
    if kind in _YAML:
        return _read_yaml_world(path)
    # The readers of foreign formats are imported when they are needed: they are slow to load.
    if kind == ".xml":
        from albot_maps.formats.plan_xml import read_plan_xml

        return read_plan_xml(path)
    if kind == ".json":
        from albot_maps.formats.house_json import read_house_json

        return read_house_json(path)
    if kind == ".world":
        from albot_maps.formats.stage_world import read_stage_world

        return read_stage_world(path)
    if kind in _PICTURES:
        return _read_yaml_world(_description_of(path))
    raise InputError(
        path, "a world file: .yaml, .xml, .json, .world, .pgm or .png", kind or "no suffix"
    )


def _read_yaml_world(path: Path) -> World:
    document = read_yaml(path)
    if isinstance(document.data, dict) and "image" in document.data:
        from albot_maps.formats.ros_grid import read_ros_grid

        return read_ros_grid(document, path)
    return world_from_document(document, source=str(path))


def _description_of(picture: Path) -> Path:
    """The YAML beside a ROS map's picture."""
    if not exists(picture):
        raise MissingFileError(picture)
    stem = picture.name.split(".")[0]
    for suffix in sorted(_YAML):
        path = picture.with_name(picture.name.replace(".gz", "")).with_suffix(suffix)
        if path.is_file():
            return path
    raise InputError(picture, f"its map_server description {stem}.yaml beside it", "none")


class WorldSet:
    """Worlds by their number. A world is loaded or made when it is first asked for.

    Args:
        worlds: The worlds, or their specs.

    Raises:
        InputError: There is no world, or the first one is wrong.
    """

    def __init__(self, worlds: Sequence[str | Path | World]) -> None:
        if not len(worlds):
            raise InputError("worlds", "at least one world", "none")
        self._worlds = worlds
        self._loaded: OrderedDict[int, World] = OrderedDict()
        self[0]  # A wrong spec raises now, not in the middle of a training.

    def __len__(self) -> int:
        """How many worlds there are."""
        return len(self._worlds)

    def __iter__(self) -> Iterator[World]:
        """The worlds in turn."""
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> World:
        """The world of a number from 0 on.

        Raises:
            InputError: No world has that number, or it is wrong.
        """
        if not 0 <= number < len(self):
            expected = f"a world's number below {len(self)}"
            raise InputError("worlds", expected, str(number))
        if number not in self._loaded:
            world = self._worlds[number]
            self._loaded[number] = world if isinstance(world, World) else load_world(world)
            if len(self._loaded) > KEPT:
                self._loaded.popitem(last=False)
        self._loaded.move_to_end(number)
        return self._loaded[number]


def load_worlds(spec: str | Path | World | WorldSet) -> WorldSet:
    """The worlds that a spec names.

    A spec with a range of seeds names as many random worlds: `random:office:0..99?rooms=8`
    those of the seeds 0 to 99. Any other names one world (see `load_world`).

    Raises:
        InputError: As `load_world`; or the range holds no seed, or the spec is of another type.
    """
    if isinstance(spec, WorldSet):
        return spec
    if not isinstance(spec, str | Path | World):
        raise InputError("world", "a world, a set of worlds, or a spec of them", repr(spec))
    found = _RANGE.fullmatch(spec) if isinstance(spec, str) else None
    if found is None:
        return WorldSet((spec,))
    first, last = int(found["first"]), int(found["last"])
    parse_spec(f"{PREFIX}{found['kind']}:{last}{found['rest'] or ''}")
    if not 0 <= last - first < _MOST:
        expected = f"a range of seeds A..B with B at least A, of {_MOST:,} seeds at most"
        raise InputError(str(spec), expected, f"{first}..{last}")
    return WorldSet(_Specs(found["kind"], range(first, last + 1), found["rest"] or ""))


class _Specs(Sequence[str]):
    """The specs of the random worlds of a range of seeds."""

    def __init__(self, kind: str, seeds: range, rest: str) -> None:
        self._kind, self._seeds, self._rest = kind, seeds, rest

    def __len__(self) -> int:
        return len(self._seeds)

    def __getitem__(self, number: int) -> str:  # type: ignore[override]
        return f"{PREFIX}{self._kind}:{self._seeds[number]}{self._rest}"
