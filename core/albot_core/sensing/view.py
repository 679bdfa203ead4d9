"""The view: the surfaces that a robot sees from where it stands (thesis, section 3.1.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int8

from albot_core.errors import InputError
from albot_core.geometry.types import Segments
from albot_core.sensing.reading import LaserScan
from albot_core.sensing.surfaces import NO_EDGE, extract_surfaces, make_bench


@dataclass(frozen=True, kw_only=True)
class ViewConfig:
    """Thresholds of view construction. The defaults are the thesis's (section 3.1.3)."""

    max_range: float = 30.0
    """Points at or beyond this distance are dropped (m); the laser's own limit also holds."""
    cluster_gap: float = 0.60
    """Neighbouring points farther apart than this begin a new cluster (m): the robot fits."""
    cluster_size: float = 0.20
    """Clusters no larger than this are not broken (m)."""
    break_height: float = 0.10
    """A cluster is broken at a point farther than this from its chord (m)."""
    surface_length: float = 0.10
    """Shorter surfaces are dropped (m)."""
    fit_lines: bool = False
    """Lay each surface on the line fitted to all its points, not from the first to the last."""

    def __post_init__(self) -> None:
        for name in ("max_range", "cluster_gap", "cluster_size", "break_height", "surface_length"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise InputError(f"ViewConfig.{name}", "a positive length (m)", str(value))

    @property
    def thresholds(self) -> Float64[np.ndarray, "4"]:
        """The four lengths that the compiled extraction takes, in its order."""
        return np.array(
            (self.cluster_gap, self.cluster_size, self.break_height, self.surface_length)
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """What is seen from one place, as line surfaces in the order of the beams."""

    surfaces: Segments
    """The surfaces in the robot's frame (m)."""
    edges: Int8[np.ndarray, "segments 2"]
    """What each surface's two ends are: NO_EDGE, OCCLUDING or CORNER."""

    def landmarks(self, shortest: float = 0.40) -> Bool[np.ndarray, "segments"]:
        """Which surfaces are landmarks: long enough (m), with an occluding or corner point."""
        run = self.surfaces[:, 2:] - self.surfaces[:, :2]
        long_enough = np.hypot(run[:, 0], run[:, 1]) >= shortest
        return np.asarray(long_enough & (self.edges != NO_EDGE).any(axis=1))


def construct_view(scan: LaserScan, config: ViewConfig = ViewConfig()) -> View:
    """Construct the view from a laser scan, by the thesis's five steps."""
    geometry = scan.geometry
    # A span needs two points, and neighbours share at most one: never more spans than beams.
    surfaces = np.empty((geometry.beams, 4))
    edges = np.empty((geometry.beams, 2), np.int8)
    count = extract_surfaces(
        scan.ranges,
        geometry.directions,
        geometry.mount[0],
        geometry.mount[1],
        min(config.max_range, geometry.max_range),
        config.thresholds,
        config.fit_lines,
        make_bench(geometry.beams),
        surfaces,
        edges,
    )
    return View(surfaces=surfaces[:count].copy(), edges=edges[:count].copy())
