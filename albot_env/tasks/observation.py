"""Observations: what the robot could know, scaled to [-1, 1] without any statistics.

An observation is a function of the readings alone: the laser and the motion come from the
reading, the rest from the mapper, which saw nothing but readings.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from gymnasium import spaces
from jaxtyping import Float, Float32, Float64

from albot_core.errors import InputError
from albot_core.mapper import Mapper, next_of
from albot_core.perception.reading import LaserGeometry, Reading, SonarGeometry
from albot_core.ranges import POSITIVE, check_fields
from albot_env.tasks.coverage import Coverage, CoverageConfig
from albot_env.tasks.kernels import observe_motions, observe_way, scale_ranges
from albot_env.tasks.survey_kernel import Scales

Parts = dict[str, Float32[np.ndarray, "..."]]
"""An observation by part: `laser`, `sonar`, `motion`, `heading`, `home`, `place`,
`exit`, `way`, `coverage`."""


@dataclass(frozen=True, kw_only=True)
class ObservationConfig:
    """How readings and beliefs become numbers in [-1, 1]."""

    laser: LaserGeometry = field(default_factory=LaserGeometry)
    """Where the laser's beams point."""
    laser_range: float = 30.0
    """Range shown as -1, as nothing at all is (m)."""
    sonar: SonarGeometry | None = field(default_factory=SonarGeometry)
    """Where the sonars point; None on a robot without."""
    sonar_range: float = 4.0
    """Range of an echo shown as -1, as none at all is (m)."""
    laser_knee: float = 0.5
    """Range of either up to which the scale is nearly linear; logarithmic beyond (m)."""
    home_range: float = 100.0
    """Distance from home shown as 1 (m)."""
    home_knee: float = 1.0
    """Distance from home up to which the scale is nearly linear; logarithmic beyond (m)."""
    step_length: float = 0.15
    """Travel in one step shown as 1, straight ahead or sideways (m)."""
    step_turn: float = 0.3
    """Turn in one step shown as 1 (rad)."""
    ways: bool = False
    """Whether the believed way home is shown: the parts `exit` and `way`."""
    coverage: CoverageConfig = field(default_factory=CoverageConfig)
    """The egocentric patch of ground covered."""

    def __post_init__(self) -> None:
        ranges = "laser_range", "sonar_range", "laser_knee", "home_range", "home_knee"
        check_fields(self, POSITIVE, *ranges, "step_length", "step_turn")

    def fitted(self, laser: LaserGeometry, sonar: SonarGeometry | None) -> ObservationConfig:
        """The same for a robot with these sensors."""
        return replace(self, laser=laser, sonar=sonar)

    @property
    def shapes(self) -> dict[str, tuple[int, ...]]:
        """The shape of each part, in the order of the flat observation."""
        side = self.coverage.patch_cells
        return {
            "laser": (self.laser.beams,),
            **({"sonar": (len(self.sonar.bearings),)} if self.sonar else {}),
            "motion": (3,),
            "heading": (2,),
            "home": (3,),
            "place": (2,),
            **({"exit": (6,), "way": (4,)} if self.ways else {}),
            "coverage": (1, side, side),
        }

    @property
    def dict_space(self) -> spaces.Space[Any]:
        """The space of observations by part."""
        return spaces.Dict(
            {name: spaces.Box(-1, 1, shape, np.float32) for name, shape in self.shapes.items()}
        )

    @property
    def flat_space(self) -> spaces.Box:
        """The space of observations in one row."""
        length = sum(int(np.prod(shape)) for shape in self.shapes.values())
        return spaces.Box(-1, 1, (length,), np.float32)

    def observe(self, reading: Reading, mapper: Mapper, coverage: Coverage) -> Parts:
        """The observation after a reading.

        `laser` is near at 1 and far at -1 (see `ranges`), and so is `sonar`, which robots
        without sonars lack; `motion` the odometer's last
        step forward, sideways and round; `heading` cosine and sine of the heading that the
        robot believes to have as seen from home; `home` the direction of home in the robot's
        frame as cosine and sine, and its distance, -1 at home; `place` whether it is in a
        place that it knows from before, and whether it has lost its way (1 or -1);
        `coverage` the patch of `Coverage.patch`. With `ways`: `exit` direction and distance of
        the next exit on the believed way home, then the direction in which to go through it,
        and 1; `way` direction and distance of a point some metres ahead on the way home that
        it remembers, and 1. Where there is none, directions are 0, the distance and the last
        number -1.
        """
        row, way = np.empty(8, np.float32), np.empty(10, np.float32)
        scales = (self.step_length, self.step_turn, self.home_knee, self.home_range)
        observe_motions(
            reading.motion,
            mapper.home,
            scales,
            row,
        )
        ahead = mapper.waypoint_home
        point = np.full(2, np.nan) if ahead is None else ahead
        observe_way(mapper.pose, next_of(mapper.exits_home), point, scales, way)
        flags = np.array((mapper.network.familiar, mapper.is_lost), np.float32)
        sonar = reading.sonar
        return {
            "laser": self.observe_ranges(reading.laser.ranges),
            **({} if sonar is None else {"sonar": self.observe_echoes(sonar.ranges)}),
            "motion": row[:3].copy(),
            "heading": row[3:5].copy(),
            "home": row[5:8].copy(),
            "place": 2 * flags - 1,
            **({"exit": way[:6].copy(), "way": way[6:].copy()} if self.ways else {}),
            "coverage": coverage.patch(mapper.pose),
        }

    def observe_ranges(self, ranges: Float[np.ndarray, "beams"]) -> Float32[np.ndarray, "beams"]:
        """Ranges (m) as the `laser` part shows them: 1 at 0, -1 at `laser_range` and beyond."""
        scaled = np.empty(len(ranges), np.float32)
        scale_ranges(np.asarray(ranges, np.float64), self.laser_knee, self.laser_range, scaled)
        return scaled

    def observe_echoes(self, ranges: Float[np.ndarray, "sonars"]) -> Float32[np.ndarray, "sonars"]:
        """Echoes (m) as the `sonar` part shows them: 1 at 0, -1 at `sonar_range` and beyond."""
        scaled = np.empty(len(ranges), np.float32)
        scale_ranges(np.asarray(ranges, np.float64), self.laser_knee, self.sonar_range, scaled)
        return scaled

    @property
    def scales(self) -> Scales:
        """What the compiled survey goes by."""
        coverage = self.coverage
        return Scales(
            cell=coverage.cell,
            spacing=coverage.spacing,
            turn=coverage.turn,
            patch_cell=coverage.patch_cell,
            patch_cells=coverage.patch_cells,
            laser_knee=self.laser_knee,
            laser_range=self.laser_range,
            sonar_range=self.sonar_range,
            step_length=self.step_length,
            step_turn=self.step_turn,
            home_knee=self.home_knee,
            home_range=self.home_range,
            ways=self.ways,
        )

    def flatten(self, parts: Parts) -> Float32[np.ndarray, "length"]:
        """All parts in one row, in the order of `shapes`."""
        return np.concatenate([parts[name].ravel() for name in self.shapes])

    def split(self, flat: Float[np.ndarray, "length"]) -> Parts:
        """The parts of a flat observation.

        Raises:
            InputError: The observation has another length.
        """
        rows = self.split_rows(flat[np.newaxis])
        return {name: part[0] for name, part in rows.items()}

    def split_rows(self, rows: Float[np.ndarray, "observations length"]) -> Parts:
        """The parts of many flat observations, each part of all of them in one array.

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
        """The ranges (m) that the `laser` part stands for, `laser_range` where nothing was."""
        return _inverse_log_scale(-laser, self.laser_knee, self.laser_range)

    def home_distance(self, scaled: float | np.floating) -> float:
        """The distance (m) that the last number of the `home` part stands for."""
        distances = np.array((float(scaled),))
        return float(_inverse_log_scale(distances, self.home_knee, self.home_range)[0])


def _inverse_log_scale(
    scaled: Float[np.ndarray, "n"], knee: float, longest: float
) -> Float64[np.ndarray, "n"]:
    """The lengths that `log_scale` made these numbers of."""
    share = (np.asarray(scaled, np.float64) + 1) / 2
    return np.asarray(knee * np.expm1(share * np.log1p(longest / knee)))
