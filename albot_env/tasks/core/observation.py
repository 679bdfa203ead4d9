"""The observation's configuration: its parts and their scales.

The parts are computed by `observation_kernels.observe_robots`, one function of
`observation_parts` for each.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from gymnasium import spaces
from jaxtyping import Float, Float32, Float64

from albot_core.errors import InputError, did_you_mean
from albot_core.ranges import FROM_ONE, POSITIVE, Range, check_fields
from albot_core.sensing.reading import LaserGeometry, SonarGeometry
from albot_env.tasks.core.coverage import CoverageConfig
from albot_env.tasks.core.observation_kernels import Layout, Scales
from albot_env.tasks.core.observation_parts import (
    LogScale,
    make_log_scale,
    unscale_ranges,
    unscaled,
)
from albot_env.tasks.core.wayfinding import WayfindingConfig

_TIME_KNEE = 0.05
"""Share of the longest time up to which the scale of times is nearly linear."""

Parts = dict[str, Float32[np.ndarray, "..."]]
"""An observation by part."""

PARTS = (
    "laser", "sonar", "motion", "heading", "home", "confidence", "place", "exit", "way", "shortcut",
    "coverage", "frontier", "onward", "time_left",
)  # fmt: skip
"""All parts, in their order in the flat observation."""
EXPLORE_AND_HOME_PARTS = tuple(part for part in PARTS if part not in ("shortcut", "onward"))
"""Parts observed in exploring and coming home."""
HOMING_PARTS = tuple(
    part for part in EXPLORE_AND_HOME_PARTS if part not in ("frontier", "time_left")
)
"""Parts observed in homing: the same without `time_left` and `frontier`."""
DEFAULT_PARTS = tuple(part for part in HOMING_PARTS if part not in ("confidence", "exit", "way"))
"""Parts observed in other tasks: without the way home, which takes time to compute."""


@dataclass(frozen=True, kw_only=True)
class ObservationConfig:
    """How readings and beliefs become numbers in [-1, 1], without any running statistics.

    All parts are functions of the readings alone: `laser`, `sonar` and `motion` come from the
    latest reading, the others from the mapper, whose only input is the readings. Directions are
    cosine and sine in the robot's frame. Distances are logarithmic, from -1 at 0 to 1 at
    `home_range`.

    Parts:
        laser: The range of each beam, or the minimum range of each sector: 1 at 0 m, -1 at
            `laser_range` and beyond, logarithmic in between.
        sonar: The range of each echo, scaled likewise up to `sonar_range`; only with sonars.
        motion: The odometer's motion in the last step: forward, sideways, and turn.
        heading: Cosine and sine of the believed heading, relative to the start heading.
        home: Direction and distance of home.
        confidence: Confidence in `home`, from 1 to -1, and -1 if the mapper is lost: the
            probability that home is within `home_near` of its believed position (see
            `home_drift`).
        place: Whether the robot is in a place that it knows from before, and whether it is lost
            (1 or -1).
        exit: Direction and distance of the next exit on the believed way home, the direction in
            which to pass it, and 1; without an exit 0, 0, -1, 0, 0, -1.
        way: Direction and distance of a point some metres ahead on the remembered way home, and
            1; without a way 0, 0, -1, -1.
        shortcut: The same for a way home through free and unseen ground, if the remembered way is
            much longer (see `WayfindingConfig`).
        coverage: The ground around the robot, in its orientation: 1 covered, -1 not. Row 0 is
            farthest ahead, column 0 farthest to the left.
        frontier: Distance of visible uncovered ground along each beam, or the middle beam of each
            sector, on the laser's scale; -1 for none (B. Yamauchi, A frontier-based approach for
            autonomous exploration, CIRA 1997).
        onward: The same as `way` for the way to uncovered ground (see `WayfindingConfig`).
        time_left: Remaining time of the robot's budget: 1 at `time_range` and more, -1 at 0,
            logarithmic in between.
    """

    laser: LaserGeometry | None = field(default_factory=LaserGeometry)
    """Geometry of the laser's beams; None on a robot without a laser, which has none of the parts
    `laser`, `shortcut`, `coverage`, `frontier` and `onward`."""
    laser_range: float = 30.0
    """Range shown as -1, like no return (m)."""
    sonar: SonarGeometry | None = field(default_factory=SonarGeometry)
    """Geometry of the sonars; None on a robot without sonars."""
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

    def __post_init__(self) -> None:
        ranges = "laser_range", "sonar_range", "laser_knee", "home_range", "home_knee"
        check_fields(self, POSITIVE, *ranges, "home_drift", "home_near", "step_length", "step_turn")
        check_fields(self, POSITIVE, "time_range")
        self._check_parts()
        if self.laser_sectors is not None:
            allowed = FROM_ONE
            if self.laser is not None:
                expected = f"a whole number from 1 to the laser's {self.laser.beams} beams"
                allowed = Range(expected, 1.0, float(self.laser.beams), whole=True)
            check_fields(self, allowed, "laser_sectors")

    def _check_parts(self) -> None:
        """Raise InputError if a part is unknown or named twice, or none is named."""
        place, known = "ObservationConfig.parts", ", ".join(PARTS)
        for part in self.parts:
            if part not in PARTS:
                found = f"{part}{did_you_mean(part, PARTS)}"
                raise InputError(place, f"some of {known}", found)
        if not self.parts or len(set(self.parts)) < len(self.parts):
            raise InputError(place, f"some of {known}, each once", str(list(self.parts)))

    def fitted(self, laser: LaserGeometry | None, sonar: SonarGeometry | None) -> ObservationConfig:
        """Return the same configuration for a robot with these sensors."""
        return replace(self, laser=laser, sonar=sonar)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of each observed part, in the order of the flat observation."""
        side = self.coverage.patch_cells
        sonars = 0 if self.sonar is None else len(self.sonar.bearings)
        beams = 0 if self.laser is None else self.laser_sectors or self.laser.beams
        nothing = {} if beams else dict.fromkeys(("shortcut", "coverage", "onward"), (0,))
        shapes: dict[str, tuple[int, ...]] = {
            "laser": (beams,),
            "sonar": (sonars,),
            "motion": (3,),
            "heading": (2,),
            "home": (3,),
            "confidence": (1,),
            "place": (2,),
            "exit": (6,),
            "way": (4,),
            "shortcut": (4,),
            "coverage": (1, side, side),
            "frontier": (beams,),
            "onward": (4,),
            "time_left": (1,),
            **nothing,
        }
        return {part: shapes[part] for part in PARTS if part in self.parts and shapes[part] != (0,)}

    @property
    def layout(self) -> Layout:
        """The position of each part in the flat observation."""
        begins, at = dict.fromkeys(PARTS, -1), 0
        for part, shape in self.shapes.items():
            begins[part] = at
            at += int(np.prod(shape))
        return Layout(**begins)

    @property
    def shows_way_home(self) -> bool:
        """Whether an observed part needs the way home."""
        return not {"confidence", "exit", "way", "shortcut"}.isdisjoint(self.parts)

    @property
    def shows_ground(self) -> bool:
        """Whether an observed part needs the ground that the robot believes covered."""
        return not {"coverage", "frontier", "onward"}.isdisjoint(self.shapes)

    @property
    def shows_ways_over_ground(self) -> bool:
        """Whether an observed part needs an occupancy grid."""
        return not {"shortcut", "onward"}.isdisjoint(self.shapes)

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
        """The space of observations by part."""
        return spaces.Dict(
            {name: spaces.Box(-1, 1, shape, np.float32) for name, shape in self.shapes.items()}
        )

    @property
    def flat_space(self) -> spaces.Box:
        """The space of flat observations."""
        length = sum(int(np.prod(shape)) for shape in self.shapes.values())
        return spaces.Box(-1, 1, (length,), np.float32)

    @property
    def laser_scale(self) -> LogScale:
        """The scale of the laser's ranges (m)."""
        return make_log_scale(self.laser_knee, self.laser_range)

    @property
    def sonar_scale(self) -> LogScale:
        """The scale of the sonars' ranges (m)."""
        return make_log_scale(self.laser_knee, self.sonar_range)

    @property
    def home_scale(self) -> LogScale:
        """The scale of distances home (m)."""
        return make_log_scale(self.home_knee, self.home_range)

    @property
    def time_scale(self) -> LogScale:
        """The scale of times left (s)."""
        return make_log_scale(_TIME_KNEE * self.time_range, self.time_range)

    @property
    def scales(self) -> Scales:
        """The scales for the compiled loop."""
        coverage = self.coverage
        return Scales(
            spacing=coverage.spacing,
            turn=coverage.turn,
            patch_cell=coverage.patch_cell,
            patch_cells=coverage.patch_cells,
            laser=self.laser_scale,
            sonar=self.sonar_scale,
            step_length=self.step_length,
            step_turn=self.step_turn,
            home=self.home_scale,
            home_drift=self.home_drift,
            home_near=self.home_near,
            sectors=self.laser_sectors or 0,
        )

    def split(self, flat: Float[np.ndarray, "length"]) -> Parts:
        """Return the parts of a flat observation.

        Raises:
            InputError: The observation has another length.
        """
        rows = self.split_rows(flat[np.newaxis])
        return {name: part[0] for name, part in rows.items()}

    def split_rows(self, rows: Float[np.ndarray, "observations length"]) -> Parts:
        """Return the parts of many flat observations, each part stacked in one array.

        Raises:
            InputError: The observations have another length.
        """
        sizes = [int(np.prod(shape)) for shape in self.shapes.values()]
        if rows.shape[1] != sum(sizes):
            raise InputError("observation", f"shape ({sum(sizes)},)", str(rows.shape[1:]))
        pieces = np.split(rows, np.cumsum(sizes)[:-1], axis=1)
        return {
            name: piece.reshape(len(rows), *shape)
            for (name, shape), piece in zip(self.shapes.items(), pieces, strict=True)
        }

    def ranges(self, laser: Float[np.ndarray, "beams"]) -> Float64[np.ndarray, "beams"]:
        """Return the ranges (m) that a `laser` part stands for; `laser_range` for no return."""
        return np.asarray(unscale_ranges(laser, self.laser_scale))

    def echoes(self, sonar: Float[np.ndarray, "sonars"]) -> Float64[np.ndarray, "sonars"]:
        """Return the ranges (m) that a `sonar` part stands for; `sonar_range` for no echo."""
        return np.asarray(unscale_ranges(sonar, self.sonar_scale))

    def travel_home(self, scaled: float | np.floating) -> float:
        """Return the travel (m) that a `confidence` part stands for; infinite at -1."""
        outside = max((1.0 - float(scaled)) / 2, 1e-9)
        return self.home_near / self.home_drift / math.sqrt(max(-2 * math.log(outside), 1e-12))

    def time_left(self, scaled: float | np.floating) -> float:
        """Return the time (s) that a `time_left` part stands for, at most `time_range`."""
        return float(unscaled(float(scaled), self.time_scale))

    def home_distance(self, scaled: float | np.floating) -> float:
        """Return the distance (m) that the last number of a `home` part stands for."""
        return float(unscaled(float(scaled), self.home_scale))
