"""The observation's configuration: its parts and their scales.

The parts are objects of `parts`; `observation_kernels` lists them and fills them in.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from gymnasium import spaces
from jaxtyping import Float, Float32

from albot_core.errors import InputError, did_you_mean
from albot_core.mappers.mapper import MapperSpec
from albot_core.ranges import FROM_ONE, POSITIVE, Range, check_fields
from albot_core.sensing.reading import LaserGeometry, SonarGeometry
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation_kernels import PARTS, Layout
from albot_env.tasks.core.parts.map_patch import MAP_PATCH, MapPatchConfig
from albot_env.tasks.core.parts.matches import MATCHES
from albot_env.tasks.core.parts.part import Decoded, Need, ObservationPart, Sizes
from albot_env.tasks.core.parts.place_graph import PLACE_GRAPH, PlaceGraphConfig
from albot_env.tasks.core.parts.scales import (
    Channels,
    GraphScales,
    PatchScales,
    Scales,
    make_log_scale,
)
from albot_env.tasks.core.parts.truth import REVEALED
from albot_env.tasks.core.wayfinding import WayfindingConfig

_TIME_KNEE = 0.05
"""Share of the longest time up to which the scale of times is nearly linear."""

Parts = dict[str, Float32[np.ndarray, "..."]]
"""An observation by part."""

PART_NAMES = tuple(part.name for part in PARTS)
"""The names of all parts, in their order in the flat observation."""
HINTS = ("exit", "way", "shortcut", "path", "onward")
"""Parts that a planner has worked out: where to drive next."""

_MATCHES = Range("a whole number from 1 to 10,000", 1.0, 10_000.0, whole=True)


def _in_order(*names: str) -> tuple[str, ...]:
    return tuple(part for part in PART_NAMES if part in names)


DEFAULT_PARTS = _in_order("laser", "sonar", "motion", "heading", "home", "place", "coverage")
"""Parts observed in exploring: without the way home, which takes time to compute."""
HOMING_PARTS = _in_order(*DEFAULT_PARTS, "confidence", "exit", "way")
"""Parts observed in homing, with hints."""
BY_MAP_PARTS = _in_order(*DEFAULT_PARTS, "map_patch", "place_graph", "matches")
"""Parts observed in tasks without hints, as far as the mapper can give them."""


def parts_by_map(mapper: MapperSpec | None, *others: str) -> tuple[str, ...]:
    """Return those of `BY_MAP_PARTS` that a mapper can give (None: no mapper), and others."""
    lacking = {part for part, is_given, _ in _optional_parts(mapper) if not is_given}
    return _in_order(*(part for part in BY_MAP_PARTS if part not in lacking), *others)


def _optional_parts(mapper: MapperSpec | None) -> tuple[tuple[str, bool, str], ...]:
    """Return name of each part that not all mappers can give, whether this can, what it lacks."""
    has_graph = mapper is not None and "place_graph" in mapper.layers
    has_matches = mapper is not None and mapper.has_matches
    return (
        (PLACE_GRAPH.name, has_graph, "has no place graph"),
        (MATCHES.name, has_matches, "does not say how sure it is of places"),
    )


@dataclass(frozen=True, kw_only=True)
class ObservationConfig:
    """How readings and beliefs become numbers in [-1, 1], without any running statistics.

    All parts are functions of the readings alone: those of the sensors come from the latest
    reading, the others from the mapper, whose only input is the readings. Directions are cosine and
    sine in the robot's frame. Distances are logarithmic, from -1 at 0 to 1 at `home_range`. What
    each part means, and its numbers, its object in `albot_env.tasks.core.parts` tells.
    """

    laser: LaserGeometry | None = field(default_factory=LaserGeometry)
    """Geometry of the laser's beams; None on a robot without a laser, which has none of the parts
    `laser`, `shortcut`, `path`, `coverage`, `frontier` and `onward`."""
    laser_range: float = 30.0
    """Range shown as -1, like no return (m)."""
    sonar: SonarGeometry | None = field(default_factory=SonarGeometry)
    """Geometry of the sonars; None on a robot without sonars."""
    has_compass: bool = False
    """Whether the robot has a compass; without one it has none of the part `compass`."""
    sonar_range: float = 4.0
    """Range of an echo shown as -1, like no echo (m)."""
    laser_knee: float = 0.5
    """Laser or sonar range up to which the scale is nearly linear; logarithmic beyond (m)."""
    home_range: float = 100.0
    """Distance from home shown as 1 (m)."""
    home_knee: float = 1.0
    """Distance from home up to which the scale is nearly linear; logarithmic beyond (m)."""
    step_length: float = 0.15
    """Distance in one step shown as 1, forward or sideways (m)."""
    step_turn: float = 0.3
    """Turn in one step shown as 1 (rad)."""
    home_drift: float = 0.05
    """Standard deviation of the believed position of home per metre of travel that the belief
    rests on; the value is that of Albot0's path integration (Schmidt, Wong and Yeap)."""
    home_near: float = 1.0
    """Radius of the confidence: the distance of home from its believed position (m)."""
    time_range: float = 600.0
    """Time left that is shown as 1 (s); more time, or no time limit, is 1 too."""
    laser_sectors: int | None = None
    """Number of equal sectors whose minimum ranges the part `laser` shows; None for every beam."""
    parts: tuple[str, ...] = DEFAULT_PARTS
    """Names of the observed parts, from `PARTS`, in any order."""
    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """Coverage grid, and the egocentric patch of it."""
    wayfinding: WayfindingConfig = field(default_factory=WayfindingConfig)
    """Parameters of the search for paths over the ground."""
    map_patch: MapPatchConfig = field(default_factory=MapPatchConfig)
    """Scales, size and channels of the part `map_patch`."""
    place_graph: PlaceGraphConfig = field(default_factory=PlaceGraphConfig)
    """Size of the part `place_graph`."""
    matches: int = 3
    """Number of rows of the part `matches`."""

    def __post_init__(self) -> None:
        ranges = "laser_range", "sonar_range", "laser_knee", "home_range", "home_knee"
        check_fields(self, POSITIVE, *ranges, "home_drift", "home_near", "step_length", "step_turn")
        check_fields(self, POSITIVE, "time_range")
        check_fields(self, _MATCHES, "matches")
        self._check_parts()
        if self.laser_sectors is not None:
            allowed = FROM_ONE
            if self.laser is not None:
                expected = f"a whole number from 1 to the laser's {self.laser.beams} beams"
                allowed = Range(expected, 1.0, float(self.laser.beams), whole=True)
            check_fields(self, allowed, "laser_sectors")

    def _check_parts(self) -> None:
        """Raise InputError if a part is unknown or named twice, or none is named."""
        place, known = "ObservationConfig.parts", ", ".join(PART_NAMES)
        for part in self.parts:
            if part not in PART_NAMES:
                found = f"{part}{did_you_mean(part, PART_NAMES)}"
                raise InputError(place, f"some of {known}", found)
        if not self.parts or len(set(self.parts)) < len(self.parts):
            raise InputError(place, f"some of {known}, each once", str(list(self.parts)))

    def fitted(
        self,
        laser: LaserGeometry | None,
        sonar: SonarGeometry | None,
        mapper: MapperSpec | None,
        *,
        has_compass: bool = False,
    ) -> ObservationConfig:
        """Return the same configuration for a robot with these sensors and this mapper.

        Raises:
            InputError: The mapper cannot give what the parts `map_patch` or `place_graph` show.
        """
        patch = self.map_patch
        if MAP_PATCH.name in self.parts:
            patch = replace(patch, channels=patch.chosen(mapper))
        for part, is_given, lacking in _optional_parts(mapper):
            if part in self.parts and not is_given:
                name = "none" if mapper is None else mapper.name
                expected = f"parts that the mapper {name} can give: it {lacking}"
                raise InputError("ObservationConfig.parts", expected, part)
        return replace(self, laser=laser, sonar=sonar, has_compass=has_compass, map_patch=patch)

    @cached_property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of each observed part, in the order of the flat observation."""
        sizes = Sizes(
            beams=0 if self.laser is None else self.laser_sectors or self.laser.beams,
            sonars=0 if self.sonar is None else len(self.sonar.bearings),
            compasses=int(self.has_compass),
            patch=self.coverage.patch_cells,
            map_layers=len(self.map_patch.sides) * len(self.map_patch.shown),
            map_cells=self.map_patch.cells,
            graph_rows=self.place_graph.places + self.place_graph.connections,
            matches=self.matches,
        )
        shapes = {part.name: part.shape(sizes) for part in PARTS if part.name in self.parts}
        return {name: shape for name, shape in shapes.items() if shape != (0,)}

    @property
    def layout(self) -> Any:
        """The position of each part in the flat observation (`Layout`)."""
        begins, at = dict.fromkeys(PART_NAMES, -1), 0
        for part, shape in self.shapes.items():
            begins[part] = at
            at += int(np.prod(shape))
        return Layout(**begins)

    def observes(self, part: ObservationPart[Any]) -> bool:
        """Return whether a part is observed."""
        return part.name in self.shapes

    def needs(self, need: Need) -> bool:
        """Return whether an observed part needs something."""
        return any(need in part.needs for part in PARTS if part.name in self.shapes)

    def reads_maps(self, mapper: MapperSpec | None) -> bool:
        """Return whether an observed part shows what is in the mapper's map (see `fitted`)."""
        layers = () if mapper is None else mapper.layers
        needed = {"walls", "exits", "places"}
        needed |= {"free"} if "occupancy_grid" in layers else set()
        needed |= {"trail"} if "trajectory" in layers else set()
        channels = self.map_patch.channels or () if MAP_PATCH.name in self.parts else ()
        return PLACE_GRAPH.name in self.parts or not needed.isdisjoint(channels)

    def require(self, parts: Collection[str], who: str) -> None:
        """Raise InputError if a part that `who` needs is not observed.

        Raises:
            InputError: One of the parts is not observed, or the laser only by sectors.
        """
        missing = [part for part in parts if part not in self.shapes]
        shown = ", ".join(self.shapes)
        if missing:
            raise InputError(who, f"observations with the part {missing[0]}", shown)
        if "laser" in parts and self.laser_sectors is not None:
            raise InputError(who, "every beam of the laser", f"{self.laser_sectors} sectors")

    @property
    def dict_space(self) -> spaces.Space[Any]:
        """The space of observations by part, in the order of flat observations."""
        # As pairs: gymnasium sorts the keys of a dict, and would flatten the parts in that order.
        return spaces.Dict(
            [(name, spaces.Box(-1, 1, shape, np.float32)) for name, shape in self.shapes.items()]
        )

    @property
    def flat_space(self) -> spaces.Box:
        """The space of flat observations."""
        return spaces.Box(-1, 1, (self._length,), np.float32)

    @cached_property
    def scales(self) -> Scales:
        """The scales of the parts."""
        coverage, knee = self.coverage, self.laser_knee
        return Scales(
            spacing=coverage.spacing,
            turn=coverage.turn,
            patch_cell=coverage.patch_cell,
            patch_cells=coverage.patch_cells,
            laser=make_log_scale(knee, self.laser_range),
            sonar=make_log_scale(knee, self.sonar_range),
            step_length=self.step_length,
            step_turn=self.step_turn,
            home=make_log_scale(self.home_knee, self.home_range),
            home_drift=self.home_drift,
            home_near=self.home_near,
            sectors=self.laser_sectors or 0,
            time=make_log_scale(_TIME_KNEE * self.time_range, self.time_range),
            patches=PatchScales(
                sides=np.array(self.map_patch.sides, np.float64),
                cells=self.map_patch.cells,
                channels=Channels.of(self.map_patch.shown),
            ),
            graph=GraphScales(**asdict(self.place_graph)),
            matches=self.matches,
        )

    def split(self, flat: Float[np.ndarray, "length"]) -> Parts:
        """Return the parts of a flat observation.

        Raises:
            InputError: The observation has another length.
        """
        self._check_length(flat)
        return {name: flat[which].reshape(shape) for name, (which, shape) in self._slice_of.items()}

    def split_rows(self, rows: Float[np.ndarray, "observations length"]) -> Parts:
        """Return the parts of many flat observations, each part stacked in one array.

        Raises:
            InputError: The observations have another length.
        """
        self._check_length(rows)
        return {
            name: rows[:, which].reshape(len(rows), *shape)
            for name, (which, shape) in self._slice_of.items()
        }

    def decode(self, part: ObservationPart[Decoded], observation: Any) -> Decoded:
        """Return what a part of an observation stands for, in SI units.

        Args:
            part: One of the observed parts.
            observation: A flat observation, or one by part.

        Raises:
            InputError: A flat observation has another length.
        """
        if isinstance(observation, dict):
            return part.decode(observation[part.name], self.scales)
        self._check_length(observation)
        which, shape = self._slice_of[part.name]
        return part.decode(observation[which].reshape(shape), self.scales)

    @cached_property
    def _slice_of(self) -> dict[str, tuple[slice, tuple[int, ...]]]:
        """The position of each observed part in the flat observation, and its shape."""
        ends = np.cumsum([math.prod(shape) for shape in self.shapes.values()]).tolist()
        begins = [0, *ends[:-1]]
        return {
            name: (slice(begin, end), shape)
            for (name, shape), begin, end in zip(self.shapes.items(), begins, ends, strict=True)
        }

    @cached_property
    def _length(self) -> int:
        """The length of a flat observation."""
        return sum(math.prod(shape) for shape in self.shapes.values())

    def place_of(self, part: ObservationPart[Any]) -> slice:
        """Return the place of an observed part in flat observations."""
        return self._slice_of[part.name][0]

    def _check_length(self, flat: Float[np.ndarray, "*observations length"]) -> None:
        if flat.shape[-1] != self._length:
            raise InputError("observation", f"shape ({self._length},)", str(flat.shape[-1:]))


def chosen_observations(config: Any, mapper: MapperSpec | None, *others: str) -> ObservationConfig:
    """Return the observation config of a task that may bar hints.

    Args:
        config: The task's config, with `observations` (None for all parts of `BY_MAP_PARTS` that
            the mapper can give) and `hints`, whether `HINTS` may be observed.
        mapper: Spec of the mapper; None without one.
        others: Further parts that are observed by default.

    Raises:
        InputError: Hints are to be observed though `config.hints` is false.
    """
    observations: ObservationConfig | None = config.observations
    if observations is None:
        hints = (*HINTS, "confidence") if config.hints else ()
        return ObservationConfig(parts=parts_by_map(mapper, *hints, *others))
    barred = [part for part in observations.parts if part in HINTS]
    if barred and not config.hints:
        name = type(config).__name__
        expected = "parts that are no hints, or hints=True"
        raise InputError(f"{name}.observations", expected, barred[0], place="parts")
    return observations


def revealed(observations: ObservationConfig, *, reveal: bool) -> ObservationConfig:
    """Return an observation config with the parts that reveal the truth, or without.

    Raises:
        InputError: It asks for one of these parts, and the truth is not to be revealed.
    """
    if reveal:
        others = (part for part in observations.parts if part not in REVEALED)
        return replace(observations, parts=(*others, *REVEALED))
    asked = [part for part in observations.parts if part in REVEALED]
    if asked:
        expected = "parts that are no truth, or an environment that reveals it (reveal=True)"
        raise InputError("ObservationConfig.parts", expected, asked[0])
    return observations
