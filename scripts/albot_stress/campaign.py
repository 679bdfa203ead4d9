"""Campaigns: which episodes a stress run has, as options say it or a YAML file.

A file is checked against the JSON Schema beside this file, and then by making one environment of
each combination. All errors are reported at once, with their lines.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, replace
from functools import cache
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import jsonschema

from albot_agents.registry import EXPLORE, agent_names, check_agent, find_agent
from albot_agents.task import find_task
from albot_core.errors import InputError, did_you_mean
from albot_core.files import exists
from albot_core.mappers.registry import NO_MAPPER, mapper_config, mapper_spec
from albot_core.plain_data import Location, read_config
from albot_core.robot import DEFAULT_ROBOT, choose_robot
from albot_core.yaml_document import YamlDocument, format_value, read_yaml
from albot_env.faults.registry import faults_text
from albot_env.sim import ODOMETERS
from albot_maps import load_world
from albot_maps.generators.spec import KINDS, PREFIX
from albot_stress.episodes import Episode, world_specs
from albot_stress.running import Checks, check_episode

NO_FAULTS = "none"
"""The entry of `faults` that stands for nothing."""
LARGEST_SEED = 2**64 - 1
"""Largest seed of a world or an episode."""
_SCHEMA = "albot-campaign.schema.json"
Value = TypeVar("Value")


class MapperChoice(NamedTuple):
    """A mapper with its parameters."""

    name: str
    """Its name, or `none`."""
    config: Any = None
    """Its parameters; None for the defaults."""
    file: Path | None = None
    """The YAML file with these parameters."""


@dataclass(frozen=True, kw_only=True)
class Campaign:
    """All worlds with all agents, mappers, odometers and faults."""

    task: str = EXPLORE
    """Id of the environment."""
    worlds: tuple[str, ...] = ("random",)
    """World specs (see `world_specs`)."""
    count: int = 100
    """Worlds of each random spec, or seeds of any other world."""
    seed: int = 0
    """The first seed, of worlds and episodes."""
    steps: int = 300
    """Length of an episode (control steps)."""
    agents: tuple[str, ...] = ("gap-explorer", "random")
    """Names of agents, or files of trained ones."""
    mappers: tuple[MapperChoice, ...] = (MapperChoice(NO_MAPPER),)
    """The mappers."""
    odometers: tuple[str | None, ...] = (None,)
    """Names of presets; None for the environment's own."""
    faults: tuple[str | None, ...] = (None,)
    """Specs of faults; None for nothing."""
    robot: str | None = None
    """Name of the robot; None for each agent's own."""
    movables: bool = True
    """Whether doors, boxes and people are simulated in worlds that have them."""
    checks: Checks = field(default_factory=Checks)
    """What is checked how often."""

    def episodes(self) -> list[Episode]:
        """Return all episodes.

        Raises:
            InputError: A world's spec or seed is not valid.
        """
        kinds = list(self._kinds())
        return [
            replace(kind, world=world, seed=self.seed + k)
            for spec in self.worlds
            for k, world in enumerate(world_specs(spec, self.count, self.seed))
            for kind in kinds
        ]

    def _kinds(self) -> Iterator[Episode]:
        """Yield an episode of each combination, without its world and seed."""
        for mapper, agent, odometer, faults in product(
            self.mappers, self.agents, self.odometers, self.faults
        ):
            yield Episode(
                world="",
                agent=agent,
                mapper=mapper.name,
                mapper_config=mapper.config,
                mapper_config_file=mapper.file,
                seed=self.seed,
                steps=self.steps,
                task=self.task,
                robot=self.robot,
                odometer=odometer,
                faults=faults,
                movables=self.movables,
            )

    def check(self) -> None:
        """Check that all combinations can be made, and the first and last worlds loaded.

        Raises:
            InputError: The first that cannot.
        """
        for error in self.errors():
            raise error

    def errors(self, place: Callable[..., str] = lambda *_: "") -> Iterator[InputError]:
        """Yield what cannot be made.

        Args:
            place: Returns the place of a key and an index in a file, for errors.
        """
        yield from self.world_errors(place)
        world = next(self._sound_worlds(), None)
        if world is None:
            return
        for index, kind in enumerate(self._kinds()):
            try:
                check_episode(replace(kind, world=world))
            except InputError as error:
                agent = index // (len(self.odometers) * len(self.faults)) % len(self.agents)
                yield _placed(error, place("agents", agent), _combination(kind))

    def world_errors(self, place: Callable[..., str] = lambda *_: "") -> Iterator[InputError]:
        """Yield which worlds cannot be loaded, or that the seeds are too large.

        Of random worlds, the first of each kind and the last are generated to see it.

        Args:
            place: As for `errors`.
        """
        last = LARGEST_SEED - self.count + 1
        if self.seed > last:
            expected = f"{last} or less, because {self.count:,} are counted from it"
            yield _placed(InputError("seed", expected, str(self.seed)), place("seed"))
            return
        radius = choose_robot(self.robot or DEFAULT_ROBOT, "robot").radius
        for k, spec in enumerate(self.worlds):
            try:
                specs = world_specs(spec, self.count, self.seed)
                for world in dict.fromkeys((*specs[: len(KINDS)], specs[-1])):
                    load_world(world, radius)
            except InputError as error:
                yield _placed(error, place("worlds", k))

    def _sound_worlds(self) -> Iterator[str]:
        """Yield the first world of each spec that can be loaded."""
        for spec in self.worlds:
            if not list(replace(self, worlds=(spec,)).world_errors()):
                yield world_specs(spec, 1, self.seed)[0]


def _combination(kind: Episode) -> str:
    """Return a combination in words."""
    parts = {"agent": kind.agent, "mapper": kind.mapper, "odometer": kind.odometer}
    parts["faults"] = kind.faults
    return ", ".join(f"{name} {value}" for name, value in parts.items() if value is not None)


class CampaignError(InputError):
    """All that is wrong with a campaign's file.

    Args:
        errors: What is wrong, each in one line.
    """

    def __init__(self, errors: Sequence[InputError]) -> None:
        first = errors[0]
        super().__init__(first.source, first.expected, first.found, place=first.place)
        self.errors = tuple(errors)
        """What is wrong."""
        self.args = ("\n".join(map(str, errors)),)

    def __reduce__(self) -> Any:
        """Return what pickling needs."""
        return CampaignError, (self.errors,)


def read_campaign(path: Path) -> Campaign:
    """Read a campaign's file.

    Raises:
        CampaignError: It is no such file, or one of its combinations is impossible: all errors,
            with their lines.
        InputError: The file cannot be read, or is not YAML.
    """
    document = read_yaml(path)
    data = {} if document.data is None else document.data
    wrong = [_schema_error(error, document, path) for error in _validator().iter_errors(data)]
    if wrong:
        raise CampaignError(sorted(wrong, key=_line))
    reader = _Reader(document, data, path)
    campaign = reader.campaign()
    reader.errors += (
        campaign.world_errors(reader.place) if reader.errors else campaign.errors(reader.place)
    )
    if reader.errors:
        raise CampaignError(sorted((_in_file(error, path) for error in reader.errors), key=_line))
    return campaign


@cache
def _validator() -> Any:
    """Return what checks documents against the schema."""
    return jsonschema.Draft202012Validator(read_schema())


def read_schema() -> dict[str, Any]:
    """Return the JSON Schema of campaigns."""
    text = (resources.files(__package__) / _SCHEMA).read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def _schema_error(error: Any, document: YamlDocument, path: Path) -> InputError:
    """Return what the schema finds as an error that names the line."""
    at = tuple(error.absolute_path)
    if error.validator == "additionalProperties":
        known = sorted(error.schema["properties"])
        unknown = sorted(set(error.instance) - set(known))
        where = document.place((*at, unknown[0]))
        found = ", ".join(f"{key}{did_you_mean(key, known)}" for key in unknown)
        return InputError(path, f"keys among {', '.join(known)}", found, place=where)
    texts: dict[str, Callable[[], str]] = {
        "type": lambda: _TYPES.get(str(error.validator_value), str(error.validator_value)),
        "minimum": lambda: f"{error.validator_value} or more",
        "maximum": lambda: f"{error.validator_value} or less",
        "exclusiveMinimum": lambda: f"more than {error.validator_value}",
        "minItems": lambda: "one entry or more",
        "minLength": lambda: "a text that is not empty",
        "anyOf": lambda: "a name, or a mapping with name and config",
    }
    expected = texts.get(str(error.validator), lambda: str(error.message))()
    return InputError(path, expected, format_value(error.instance), place=document.place(at))


_TYPES = {
    "object": "a mapping",
    "array": "a list",
    "string": "a text",
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
}
"""What a type of the schema is called in errors."""


class _Reader:
    """Makes a campaign of a document that fits the schema, and collects errors.

    Args:
        document: The document.
        data: Its data.
        path: The file.
    """

    def __init__(self, document: YamlDocument, data: dict[str, Any], path: Path) -> None:
        self._document, self._data, self._path = document, data, path
        self.errors: list[InputError] = []
        """What is wrong."""

    def place(self, *at: str | int) -> str:
        """Return the place of a value: its line and key."""
        return self._document.place(at)

    @contextmanager
    def _collected(self, *at: str | int) -> Iterator[None]:
        """Collect an error that is raised in the block, with its place."""
        try:
            yield
        except InputError as error:
            self.errors.append(_placed(error, self.place(*at)))

    def campaign(self) -> Campaign:
        """Return the campaign; where there was an error, with the default."""
        data, given = self._data, dict(self._data)
        usual = Campaign()
        task = None
        with self._collected("task"):
            task = given["task"] = find_task(data.get("task", usual.task))
        if "agents" in data:
            given["agents"] = self._each("agents", lambda name: self._agent(name, task))
        if "mappers" in data:
            given["mappers"] = self._each("mappers", self._mapper)
        if "odometers" in data:
            given["odometers"] = self._each("odometers", _check_odometer)
        if "faults" in data:
            given["faults"] = self._each("faults", _check_faults)
        if "worlds" in data:
            given["worlds"] = self._each("worlds", self._world)
        if "robot" in data:
            given["robot"] = None
            with self._collected("robot"):
                choose_robot(data["robot"], "robot")
                given["robot"] = data["robot"]
        where = Location(self._path, ("checks",), self._document.place)
        given["checks"] = read_config(Checks, data.get("checks", {}), where)
        known = {each.name for each in fields(Campaign)}
        return Campaign(**{name: value for name, value in given.items() if name in known})

    def _each(self, key: str, read: Callable[[Any], Value]) -> tuple[Value, ...]:
        """Return the entries of a list, each once."""
        found: list[Value] = []
        for k, entry in enumerate(self._data[key]):
            with self._collected(key, k):
                value = read(entry)
                if value in found:
                    raise InputError(key, "each entry once", f"{format_value(entry)} twice")
                found.append(value)
        return tuple(found)

    def _agent(self, name: str, task: str | None) -> str:
        """Return an agent's name, or the path of its file, checked; for any task if it is None."""
        beside = self._path.parent / name
        name = str(beside) if name not in agent_names() and exists(beside) else name
        if task is None:
            find_agent(name)
        else:
            check_agent(name, task)
        return name

    def _mapper(self, entry: str | dict[str, str]) -> MapperChoice:
        """Return a mapper with its parameters, checked."""
        name, file = (entry, None) if isinstance(entry, str) else (entry["name"], entry["config"])
        if name == NO_MAPPER and file is None:
            return MapperChoice(NO_MAPPER)
        spec = mapper_spec(name)
        if file is None:
            return MapperChoice(name)
        path = self._path.parent / file
        document = read_yaml(path)
        where = Location(path, place=document.place)
        return MapperChoice(name, mapper_config(spec, document.data, where), path)

    def _world(self, spec: str) -> str:
        """Return a world's spec; a file is looked for beside the campaign's."""
        beside = self._path.parent / spec
        is_file = exists(beside) and beside.is_file()
        return str(beside) if is_file and not spec.startswith(PREFIX[:-1]) else spec


def _check_odometer(name: str) -> str:
    if name not in ODOMETERS:
        found = f"{name}{did_you_mean(name, ODOMETERS)}"
        raise InputError("odometer", f"one of {', '.join(ODOMETERS)}", found)
    return name


def _check_faults(spec: str) -> str | None:
    return None if spec == NO_FAULTS else faults_text(spec)


def _placed(error: InputError, place: str, what: str = "") -> InputError:
    """Return an error whose source is a part of a campaign, at a place in its file."""
    known = place.rpartition(", ")[2]
    parts = dict.fromkeys((what, error.source, error.place))
    inner = ", ".join(part for part in parts if part and part != known)
    return InputError(place or inner, error.expected, error.found, place=inner if place else "")


def _in_file(error: InputError, path: Path) -> InputError:
    """Return an error with the file before its place."""
    place = ", ".join(part for part in (error.source, error.place) if part)
    return InputError(path, error.expected, error.found, place=place)


def _line(error: InputError) -> int:
    """Return the line that an error names; 0 for none."""
    words = error.place.removeprefix("line ").split(",")[0]
    return int(words) if words.isdecimal() else 0
