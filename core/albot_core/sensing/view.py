"""The view: the surfaces that a robot sees from its current pose (thesis, section 3.1.3).

A view is constructed from a laser scan in five steps: points, clusters, clusters broken at corners,
one surface per piece, and the type of each surface's ends. `extract_surfaces` runs all five.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Int8

from albot_core.geometry.types import Segments
from albot_core.kernels.compiled import ZERO, kernel
from albot_core.ranges import FROM_TWO, NOT_NEGATIVE, POSITIVE, check_fields
from albot_core.sensing.beam_model import BeamModel
from albot_core.sensing.line_fit import fit_line
from albot_core.sensing.reading import LaserGeometry, LaserScan
from albot_core.sensing.segmentation import scan_points, segment_points, set_gaps

NO_EDGE, OCCLUDING, CORNER = 0, 1, 2
"""Types of a surface's ends: not stable, an occluding point, or a corner point."""


@dataclass(frozen=True, kw_only=True)
class ViewConfig:
    """Parameters of view construction. The defaults are those of the thesis (section 3.1.3)."""

    max_range: float = 30.0
    """Points at or beyond this distance are dropped (m); so are those beyond the laser's range."""
    cluster_gap: float = 0.60
    """Distance of neighbouring points (m) above which a new cluster begins: the robot fits."""
    cluster_size: float = 0.20
    """Clusters of at most this size are not broken (m)."""
    break_height: float = 0.10
    """Distance of a point from its cluster's chord (m) above which the cluster is broken there."""
    surface_length: float = 0.10
    """Least length of a surface (m); shorter ones are dropped."""
    surface_points: int = 2
    """Least number of points of a surface. Two points alone may belong to two surfaces, of which
    one occludes the other."""
    min_incidence: float = 0.0
    """Angle between beam and wall (rad) down to which neighbouring points of one wall stay in one
    cluster, however far apart. At 0, as in the thesis, only `cluster_gap` is used; so it is with a
    laser whose beams are half this angle apart or more. It is the adaptive breakpoint of Borges and
    Aldon (2004)."""
    cut_ends: bool = False
    """Whether an end where a wall only leaves the laser's range is no occluding point. In the
    thesis, which does not mention walls out of range, such ends are occluding points."""
    beam_model: bool = False
    """Whether a point lies at the nearer edge of its beam, and its weight depends on how precisely
    it fixes its wall (`beam_model`). In the thesis points lie on their beams' axes; with a laser
    such as a SICK, a wall beside the robot is then turned towards it by half the `beam_width`."""
    bend_significance: float = 0.0
    """F statistic above which two lines fit a cluster better than one, so that it is broken at the
    bend; 0 for never, as in the thesis. A bent wall that is drawn straight has a different position
    and heading from each pose from which it is seen."""
    fit_lines: bool = False
    """Whether a surface lies on the line fitted to all its points, instead of running from its
    first point to its last."""
    grazing_ends: bool = False
    """Whether the nearer end is an occluding point also where one wall, seen at grazing incidence,
    breaks into two clusters. In the thesis an occluding point obstructs another surface's edge
    (section 3.1.4)."""

    def __post_init__(self) -> None:
        lengths = "max_range", "cluster_gap", "cluster_size", "break_height", "surface_length"
        check_fields(self, POSITIVE, *lengths)
        check_fields(self, NOT_NEGATIVE, "min_incidence", "bend_significance")
        check_fields(self, FROM_TWO, "surface_points")


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """The surfaces seen from one pose, in the order of the beams."""

    surfaces: Segments
    """The surfaces in the robot's frame (m)."""
    edges: Int8[np.ndarray, "segments 2"]
    """Types of each surface's two ends: NO_EDGE, OCCLUDING or CORNER."""

    def landmarks(self, shortest: float = 0.40) -> Bool[np.ndarray, "segments"]:
        """Return which surfaces are landmarks: `shortest` or longer (m), not all ends NO_EDGE."""
        run = self.surfaces[:, 2:] - self.surfaces[:, :2]
        long_enough = np.hypot(run[:, 0], run[:, 1]) >= shortest
        return np.asarray(long_enough & (self.edges != NO_EDGE).any(axis=1))


class ViewSettings(NamedTuple):
    """A laser, and the parameters of view construction, for compiled code."""

    directions: np.ndarray
    """(beams, 2) float64: unit vectors of the beams in the robot's frame."""
    beam_model: BeamModel
    """The model of the beams."""
    mount: tuple[float, float]
    """Position of the laser in the robot's frame (m)."""
    max_range: float
    """Points at or beyond this distance are dropped (m)."""
    cluster_gap: float
    """See `ViewConfig`, also for those that follow."""
    cluster_size: float
    break_height: float
    surface_length: float
    surface_points: int
    min_incidence: float
    bend_significance: float
    fit_lines: bool
    grazing_ends: bool
    cut_ends: bool


def view_settings(laser: LaserGeometry, config: ViewConfig) -> ViewSettings:
    """Return the settings with which views are constructed from this laser's scans."""
    return ViewSettings(
        directions=laser.directions,
        beam_model=BeamModel(laser.spacing, laser.beam_width, config.beam_model),
        mount=(float(laser.mount[0]), float(laser.mount[1])),
        max_range=float(min(laser.max_range, config.max_range)),
        cluster_gap=float(config.cluster_gap),
        cluster_size=float(config.cluster_size),
        break_height=float(config.break_height),
        surface_length=float(config.surface_length),
        surface_points=int(config.surface_points),
        min_incidence=float(config.min_incidence),
        bend_significance=float(config.bend_significance),
        fit_lines=config.fit_lines,
        grazing_ends=config.grazing_ends,
        cut_ends=config.cut_ends,
    )


def construct_view(scan: LaserScan, config: ViewConfig = ViewConfig()) -> View:
    """Construct the view from a laser scan, by the thesis's five steps."""
    beams, settings = scan.geometry.beams, view_settings(scan.geometry, config)
    # A span needs two points, and neighbours share at most one: never more spans than beams.
    surfaces, edges = np.empty((beams, 4)), np.empty((beams, 2), np.int8)
    count = extract_surfaces(scan.ranges, settings, make_view_buffers(beams), surfaces, edges)
    return View(surfaces=surfaces[:count].copy(), edges=edges[:count].copy())


@kernel()
def extract_surfaces(
    ranges: np.ndarray,
    settings: ViewSettings,
    buffers: ViewBuffers,
    surfaces: np.ndarray,
    edges: np.ndarray,
) -> int:
    """Run all steps of view construction (thesis, section 3.1.3); return the number of surfaces.

    `surfaces` and `edges` are written in the robot's frame (m), in the order of the beams.
    """
    height, shortest = settings.break_height, settings.surface_length
    eye, max_range, directions = settings.mount, settings.max_range, settings.directions
    points, beams, gaps, stack, spans, weights, lines, raw, kept = buffers
    model, fit = settings.beam_model, settings.fit_lines
    seen = scan_points(ranges, directions, *eye, max_range, model, points, beams)
    set_gaps(ranges, directions, beams[:seen], settings.cluster_gap, settings.min_incidence, gaps)
    size, bend = settings.cluster_size, settings.bend_significance
    formed = segment_points(points, seen, gaps, size, height, bend, stack, spans)
    form_surfaces(points, spans, formed, fit, height, eye, model, weights, lines, raw)
    count = ZERO
    for k in range(formed):
        if count == surfaces.shape[0]:
            break
        dx, dy = raw[k, 2] - raw[k, 0], raw[k, 3] - raw[k, 1]
        if spans[k, 1] - spans[k, 0] + 1 < settings.surface_points:
            continue
        if dx * dx + dy * dy >= shortest * shortest:
            for i in range(4):
                surfaces[count, i] = raw[k, i]
            kept[count] = k
            count += 1
    mark_edges(surfaces, spans[:formed], kept, count, *eye, edges)
    if settings.cut_ends:
        unmark_cut_ends(ranges, settings, surfaces, spans, kept, count, beams, edges)
    if not settings.grazing_ends:
        unmark_grazing_ends(points, surfaces, spans[:formed], kept, count, height, edges)
    return int(count)


class ViewBuffers(NamedTuple):
    """Scratch buffers of `extract_surfaces`, which can be reused for any number of scans."""

    points: np.ndarray
    """(beams, 2) float64: the points of the scan (m)."""
    beams: np.ndarray
    """(beams,) int64: the beam of each point."""
    gaps: np.ndarray
    """(beams,) float64: see `set_gaps`."""
    stack: np.ndarray
    """(beams + 1, 2) int64: first and last points of pieces still to be checked for a break."""
    spans: np.ndarray
    """(2 beams + 2, 3) int64: see `segment_points`."""
    weights: np.ndarray
    """(beams,) float64: the weight of each point in the fit of its line."""
    lines: np.ndarray
    """(2 beams + 2, 4) float64: see `form_surfaces`."""
    raw: np.ndarray
    """(2 beams + 2, 4) float64: the surfaces, including those that are too short."""
    kept: np.ndarray
    """(2 beams + 2,) int64: the spans of the surfaces that are long enough."""


@kernel(arrays=True)
def make_view_buffers(beams: int) -> ViewBuffers:
    """Make buffers for scans of `beams` beams."""
    spans = 2 * beams + 2
    return ViewBuffers(
        np.empty((beams, 2)),
        np.empty(beams, np.int64),
        np.empty(beams),
        np.empty((beams + 1, 2), np.int64),
        np.empty((spans, 3), np.int64),
        np.empty(beams),
        np.empty((spans, 4)),
        np.empty((spans, 4)),
        np.empty(spans, np.int64),
    )


@kernel()
def form_surfaces(
    points: np.ndarray,
    spans: np.ndarray,
    count: int,
    fit: bool,
    break_height: float,
    eye: tuple[float, float],
    model: BeamModel,
    weights: np.ndarray,
    lines: np.ndarray,
    surfaces: np.ndarray,
) -> None:
    """Form one surface for each span; write the fitted lines to `lines` (count, 4) (step 4).

    `weights` (points,) is a scratch buffer.

    Without `fit`, a surface runs from the span's first point to its last. With `fit`, the surface
    lies on the line fitted to all the span's points. Two surfaces that share a break point then
    meet where their lines cross, if that is within `break_height` of the break point.
    """
    for k in range(count):
        first, last = spans[k, 0], spans[k, 1]
        surfaces[k, 0], surfaces[k, 1] = points[first, 0], points[first, 1]
        surfaces[k, 2], surfaces[k, 3] = points[last, 0], points[last, 1]
    if not fit:
        return
    for k in range(count):
        first, last = spans[k, 0], spans[k, 1]
        # The shared break point may belong to the neighbour alone, so longer fits leave it out.
        trim = 1 if last - first >= 4 else 0
        fit_line(points, first + trim, last - trim, eye, model, weights, lines[k])
        surfaces[k, 0], surfaces[k, 1] = _foot(lines[k], surfaces[k, 0], surfaces[k, 1])
        surfaces[k, 2], surfaces[k, 3] = _foot(lines[k], surfaces[k, 2], surfaces[k, 3])
    for k in range(1, count):
        shared = spans[k, 0]
        if spans[k - 1, 1] != shared:
            continue
        px, py = points[shared, 0], points[shared, 1]
        x, y = _crossing(lines[k - 1], lines[k], px, py)
        if (x - px) ** 2 + (y - py) ** 2 < break_height**2:
            surfaces[k - 1, 2], surfaces[k - 1, 3] = x, y
            surfaces[k, 0], surfaces[k, 1] = x, y


@kernel()
def _foot(line: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Return the point of the line nearest to (x, y)."""
    along = (x - line[0]) * line[2] + (y - line[1]) * line[3]
    return line[0] + along * line[2], line[1] + along * line[3]


@kernel()
def _crossing(a: np.ndarray, b: np.ndarray, x: float, y: float) -> tuple[float, float]:
    """Return the intersection of two lines; (x, y) itself if they are nearly parallel."""
    cross = a[2] * b[3] - a[3] * b[2]
    if abs(cross) < 0.2:
        return x, y
    along = ((b[0] - a[0]) * b[3] - (b[1] - a[1]) * b[2]) / cross
    return a[0] + along * a[2], a[1] + along * a[3]


@kernel()
def mark_edges(
    surfaces: np.ndarray,
    spans: np.ndarray,
    kept: np.ndarray,
    count: int,
    eye_x: float,
    eye_y: float,
    edges: np.ndarray,
) -> None:
    """Write the types of every surface's two ends to `edges` (thesis, section 3.1.4; step 5).

    Two neighbouring surfaces from one cluster meet at a corner point. Otherwise the end closer to
    the laser at (eye_x, eye_y) is an occluding point. The first and the last end of the view are
    cut by the field of view and are neither.
    """
    for k in range(count):
        edges[k, 0] = NO_EDGE
        edges[k, 1] = NO_EDGE
    for k in range(1, count):
        if spans[kept[k - 1], 2] == spans[kept[k], 2]:
            edges[k - 1, 1] = CORNER
            edges[k, 0] = CORNER
            continue
        before = (surfaces[k - 1, 2] - eye_x) ** 2 + (surfaces[k - 1, 3] - eye_y) ** 2
        after = (surfaces[k, 0] - eye_x) ** 2 + (surfaces[k, 1] - eye_y) ** 2
        if before <= after:
            edges[k - 1, 1] = OCCLUDING
        else:
            edges[k, 0] = OCCLUDING


@kernel()
def unmark_cut_ends(
    ranges: np.ndarray,
    settings: ViewSettings,
    surfaces: np.ndarray,
    spans: np.ndarray,
    kept: np.ndarray,
    count: int,
    beams: np.ndarray,
    edges: np.ndarray,
) -> None:
    """Remove the occluding points where a wall only leaves the laser's range.

    This is ours. A beam without return beside an end shows no surface up to the range; if it would
    hit the same wall beyond the range, the wall may go on there.
    """
    directions, max_range = settings.directions, settings.max_range
    mount_x, mount_y = settings.mount
    for k in range(count):
        ux, uy = surfaces[k, 2] - surfaces[k, 0], surfaces[k, 3] - surfaces[k, 1]
        for end in range(2):
            beam = beams[spans[kept[k], end]] + 2 * end - 1
            is_last = beam < 0 or beam >= ranges.shape[0]
            if edges[k, end] != OCCLUDING or is_last or ranges[beam] < max_range:
                continue
            px, py = surfaces[k, 2 * end] - mount_x, surfaces[k, 2 * end + 1] - mount_y
            across = directions[beam, 0] * uy - directions[beam, 1] * ux
            along = (px * uy - py * ux) / across if across != 0.0 else np.inf
            if along <= 0.0 or along >= max_range:
                edges[k, end] = NO_EDGE


@kernel()
def unmark_grazing_ends(
    points: np.ndarray,
    surfaces: np.ndarray,
    spans: np.ndarray,
    kept: np.ndarray,
    count: int,
    tolerance: float,
    edges: np.ndarray,
) -> None:
    """Remove the occluding points that obstruct nothing (thesis, section 3.1.4).

    Where the next point seen lies beyond the end, within `tolerance` (m) of the surface's line, the
    wall goes on there, but too few beams hit it.
    """
    for k in range(count):
        for end in range(2):
            if edges[k, end] != OCCLUDING:
                continue
            step, span = 2 * end - 1, kept[k]  # to the last span of the cluster on this side
            while 0 <= span + step < spans.shape[0] and spans[span + step, 2] == spans[span, 2]:
                span += step
            beyond = points[spans[span, end] + step]
            ux = surfaces[k, 2 * end] - surfaces[k, 2 - 2 * end]
            uy = surfaces[k, 2 * end + 1] - surfaces[k, 3 - 2 * end]
            dx, dy = beyond[0] - surfaces[k, 2 * end], beyond[1] - surfaces[k, 2 * end + 1]
            aside = abs(ux * dy - uy * dx) / np.sqrt(ux * ux + uy * uy)
            if ux * dx + uy * dy > 0.0 and aside <= tolerance:
                edges[k, end] = NO_EDGE
