"""The observer: makes an observation of a reading, as the compiled survey does for many robots.

An observation is a function of the readings alone: the laser and the motion come from the
reading, the rest from the mapper, which saw nothing but readings.
"""

from __future__ import annotations

import math

import numpy as np
from jaxtyping import Float, Float32

from albot_core.errors import InputError
from albot_core.mappers.mapper import EXIT, POINT, TRAVEL, Mapper
from albot_core.sensing.reading import Reading
from albot_env.tasks.coverage import Coverage
from albot_env.tasks.kernels import (
    find_nearest,
    observe_confidence,
    observe_exit,
    observe_home,
    observe_motion,
    observe_time,
    observe_way,
)
from albot_env.tasks.log_scale import scale_ranges
from albot_env.tasks.observation import PARTS, ObservationConfig, Parts
from albot_env.tasks.wayfinding import Wayfinding


def observe(
    config: ObservationConfig,
    reading: Reading,
    mapper: Mapper,
    coverage: Coverage,
    time_left: float = math.inf,
    wayfinding: Wayfinding | None = None,
) -> Parts:
    """The observation after a reading, with so much time left (s).

    `laser` is near at 1 and far at -1 (see `observe_ranges`), and so is `sonar`, which robots
    without sonars lack; `motion` the odometer's last step forward, sideways and round; `heading`
    cosine and sine of the heading that the robot believes to have as seen from home; `home` the
    direction of home in the robot's frame as cosine and sine, and its distance, -1 at home;
    `confidence` how sure the mapper may be of that, from 1 to -1 where it has lost its way (see
    `ObservationConfig.home_drift`); `place` whether it is in a place that it knows from before,
    and whether it has lost its way (1 or -1); `exit` direction and distance of the next exit on
    the believed way home, then the direction in which to go through it, and 1; `way` direction
    and distance of a point some metres ahead on the way home that it remembers, and 1;
    `shortcut` the same of a way home not known to be barred, where the remembered one is much
    longer, and `onward` of the way to ground not covered (see `WayfindingConfig`); where there is
    none, directions are 0, the distance and the last number -1; `coverage` the patch
    of `Coverage.patch`; `frontier` how near, in each sector that the laser part shows, ground is
    in sight that is not covered, on the laser's scale, -1 for none (see `Coverage.frontier`);
    `time_left` what is left of a time that the robot is given, -1 when it is up.

    Raises:
        InputError: There is no wayfinding, and ways over the ground are shown.
    """
    if config.shows_ways_over_ground and wayfinding is None:
        raise InputError("observe", "a Wayfinding that has followed the robot", "None")
    way = mapper.way_home if config.shows_way_home else np.full(7, np.nan)
    home, flags = mapper.home, (mapper.network.familiar, mapper.is_lost)
    scale = config.home_scale
    parts = {name: np.empty(shape, np.float32) for name, shape in config.shapes.items()}
    shown = parts | {name: np.empty(6, np.float32) for name in PARTS if name not in parts}
    observe_motion(reading.motion, config.step_length, config.step_turn, shown["motion"])
    shown["heading"][:2] = np.cos(home[2]), -np.sin(home[2])
    observe_home(home, scale, shown["home"])
    shown["confidence"][0] = observe_confidence(way[TRAVEL], config.home_drift, config.home_near)
    shown["place"][:2] = np.where(flags, 1, -1)
    observe_exit(mapper.pose, way[EXIT], scale, shown["exit"])
    observe_way(mapper.pose, way[POINT], scale, shown["way"])
    if wayfinding is not None:
        shortcut = wayfinding.shortcut(way[TRAVEL])
        observe_way(mapper.pose, shortcut, scale, shown["shortcut"])
        observe_way(mapper.pose, wayfinding.onward, scale, shown["onward"])
    if "laser" in parts:
        parts["laser"] = observe_ranges(config, reading.laser.ranges)
    if "sonar" in parts and reading.sonar is not None:
        echoes = reading.sonar.ranges
        scale_ranges(echoes, config.sonar_scale, parts["sonar"])
    if "coverage" in parts:
        parts["coverage"] = coverage.patch(mapper.pose)
    if "frontier" in parts:
        found = coverage.frontier(mapper.pose, reading.laser, len(parts["frontier"]))
        scale_ranges(found, config.laser_scale, parts["frontier"])
    shown["time_left"][0] = observe_time(time_left, config.time_scale)
    return parts


def observe_ranges(
    config: ObservationConfig, ranges: Float[np.ndarray, "beams"]
) -> Float32[np.ndarray, "shown"]:
    """Ranges (m) as the `laser` part shows them: 1 at 0, -1 at `laser_range` and beyond."""
    shown = np.asarray(ranges, np.float64)
    if config.laser_sectors is not None:
        beams, shown = shown, np.empty(config.laser_sectors)
        find_nearest(beams, shown)
    scaled = np.empty(len(shown), np.float32)
    scale_ranges(shown, config.laser_scale, scaled)
    return scaled
