"""Sahabot 2's home vectors by landmarks, on a grid of points around the nest (figure 2.13)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float64

from albot_core.drawing.palette import BELIEVED, HOME, WALL
from albot_core.evaluation.intervals import bootstrap
from albot_core.geometry.poses import wrap_angle
from albot_core.geometry.types import Points
from albot_core.mappers.sahabot.config import SectorConfig
from albot_core.mappers.sahabot.landmarks import (
    Homing,
    Sectors,
    find_landmarks,
    home_by_average,
    home_by_snapshot,
)
from albot_core.mappers.sahabot.panorama import DIRECTIONS, UNSEEN, beams_of, look
from albot_env.sim.compass import COMPASSES
from albot_env.sim.laser import LASERS, RayCaster
from albot_experiments.desert import desert, drawn_posts
from albot_experiments.report import Figures, Report, each_seed
from albot_maps.world import World

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "sahabot-2"
TITLE = "Home vectors by the average landmark vector, with 4 and with 27 landmarks (figure 2.13)"
ARRAYS: Mapping[int, tuple[float, float, float]] = {4: (2.5, 4.0, 2.5), 27: (1.5, 8.0, 1.2)}
"""By number of posts: the inner and outer radius of their ring, and their least distance (m)."""
MODELS: Mapping[str, Callable[[Sectors, Sectors], Homing]] = {
    "alv": home_by_average,
    "snapshot": home_by_snapshot,
}
GRID = np.linspace(-4.0, 4.0, 9)
"""x and y of the points from which the nest is to be found (m)."""
NO_COMPASS = "no compass"
COMPASS = "polarised"
_NEAR_NEST, _NEAR_POST = 0.5, 0.5
"""Points nearer to the nest or to a post than this are left out (m)."""
CONDITIONS = {
    "environment": (
        "4 landmarks in the desert; 27 landmarks in simulation",
        "posts 0.4 m wide at places drawn for each seed, none within 2.5 m (4) or 1.5 m (27) of "
        "the nest",
    ),
    "sensors": (
        "panoramic camera, compass",
        f"laser `panoramic`, with 1 cm of noise; compass `{COMPASS}`",
    ),
    "points": ("a grid drawn on the ground", "9 × 9 points, 1 m apart"),
}
PAPER: Mapping[str, Figures] = {"leads_home_by_4": True, "leads_home_by_27": True}
MOST_ERROR, LEAST_SHARE = 25.0, 0.95
"""Bounds: mean angular error (degrees), and least share of points at which it is below 90°."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HomeVectors:
    """Home vectors in one array of posts."""

    posts: Float64[np.ndarray, "posts 2"]
    """The posts (m)."""
    points: Float64[np.ndarray, "points 2"]
    """The points (m)."""
    vectors: Float64[np.ndarray, "points 2"]
    """The home vector at each."""

    @property
    def errors(self) -> Float64[np.ndarray, "points"]:
        """Angle between home vector and true direction at each point (degrees); 90 for none."""
        found = np.arctan2(self.vectors[:, 1], self.vectors[:, 0])
        true = np.arctan2(-self.points[:, 1], -self.points[:, 0])
        errors = np.degrees(np.abs(wrap_angle(found - true)))
        return np.where(np.hypot(*self.vectors.T) > 0, errors, 90.0)


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Find the home vectors in an array of posts per seed and number of posts.

    Raises:
        InputError: No seeds.
    """
    found = [
        {count: home_vectors(count, seed) for count in ARRAYS}
        for seed in each_seed(seeds, progress)
    ]
    return report(found, seeds)


def home_vectors(count: int, seed: int) -> dict[str, HomeVectors]:
    """Return the home vectors by each model, and by `alv` without a compass, in one array."""
    rng = np.random.default_rng((count, seed))
    posts = drawn_posts(count, *ARRAYS[count], rng)
    points = np.stack(np.meshgrid(GRID, GRID), axis=-1).reshape(-1, 2)
    to_post = np.hypot(*(points[:, None] - posts).transpose(2, 0, 1)).min(axis=1)
    points = points[(np.hypot(*points.T) >= _NEAR_NEST) & (to_post >= _NEAR_POST)]
    eye = _Eye(desert(posts), rng)
    nest = eye.landmarks(np.zeros(2))
    seen = [eye.landmarks(point) for point in points]
    unaligned = [eye.landmarks(point, has_compass=False) for point in points]
    views: dict[str, tuple[Any, list[Sectors]]] = {
        name: (model, seen) for name, model in MODELS.items()
    }
    views[NO_COMPASS] = home_by_average, unaligned
    return {
        name: HomeVectors(
            posts=posts,
            points=points,
            vectors=np.array([_home(model, now, nest) for now in its]),
        )
        for name, (model, its) in views.items()
    }


def _home(
    model: Callable[[Sectors, Sectors], Homing], now: Sectors, nest: Sectors
) -> Float64[np.ndarray, "2"]:
    """Return a home vector; 0 where no landmark is in view."""
    return model(now, nest).direction if len(now) and len(nest) else np.zeros(2)


class _Eye:
    """Laser and compass of a robot that is put down at a point, with any heading."""

    def __init__(self, world: World, rng: np.random.Generator) -> None:
        self._laser, self._compass, self._rng = LASERS["panoramic"], COMPASSES[COMPASS], rng
        self._rays = RayCaster(world.walls, self._laser.geometry)

    def landmarks(self, point: Points, *, has_compass: bool = True) -> Sectors:
        """Return the landmarks in view, by directions of the compass, or of the robot."""
        heading = float(self._rng.uniform(-math.pi, math.pi))
        ranges = self._rays.scan(np.array((*point, heading)))
        noise = self._rng.normal(0.0, self._laser.range_noise, len(ranges))
        ranges = np.where(np.isfinite(ranges), np.maximum(ranges + noise, 0.0), ranges)
        deviation = math.hypot(self._compass.noise, self._compass.drift)
        shown = heading + float(self._rng.normal(0.0, deviation)) if has_compass else 0.0
        panorama = np.full(DIRECTIONS, UNSEEN)
        look(panorama, np.zeros(DIRECTIONS), shown, beams_of(self._laser.geometry), ranges)
        return find_landmarks(panorama, SectorConfig())


def report(found: Sequence[Mapping[int, Mapping[str, HomeVectors]]], seeds: range) -> Report:
    """Return the report of the home vectors of all seeds."""
    measured: dict[str, Figures] = {}
    groups: dict[str, Figures] = {}
    for count in ARRAYS:
        for model in (*MODELS, NO_COMPASS):
            errors = [each[count][model].errors for each in found]
            figures = _figures(errors)
            groups[f"{count} landmarks, {model}"] = figures
            if model == "alv":
                measured[f"leads_home_by_{count}"] = bool(
                    figures["mean_error_deg"] <= MOST_ERROR
                    and figures["below_90_deg"] >= LEAST_SHARE
                )
    holds = all(measured.values())
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured={**measured, **groups, "seeds": len(found)},
        holds=holds,
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"home_vectors": _picture(found[0])},
    )


def _figures(errors: Sequence[Float64[np.ndarray, "points"]]) -> dict[str, Any]:
    """Return the figures of one model; the interval is over arrays, one a seed."""
    means = np.array([each.mean() for each in errors])
    low, high = bootstrap(means, np.mean, np.random.default_rng(0))
    every = np.concatenate(errors)
    return {
        "mean_error_deg": round(float(means.mean()), 1),
        "low": round(low, 1),
        "high": round(high, 1),
        "median_error_deg": round(float(np.median(every)), 1),
        "below_90_deg": round(float((every < 90.0).mean()), 3),
    }


def _text(seeds: range) -> str:
    return f"""
Posts stand around the nest at places drawn for each of the seeds {seeds.start} to
{seeds.stop - 1}, 4 or 27 of them. At the nest and at each point of a grid of 9 × 9 around it a
robot with any heading looks round. `alv` is the average landmark vector of the point minus that of
the nest; `snapshot` matches the sectors of the two panoramas one by one; `no compass` is `alv` of a
robot that takes its own heading for that of the nest. `mean_error_deg` is the mean angle between
home vector and true direction, with a bootstrapped 95 % interval over the arrays; by chance it
would be 90°. `below_90_deg` is the share of points from which a step along the vector leads nearer
to the nest.

The thesis shows home vectors in a figure and gives no numbers. Reached where, by `alv`, the mean
error is {MOST_ERROR:g}° at most and {LEAST_SHARE:.0%} of the vectors lead nearer; both bounds are
ours. The picture shows the first seed.
"""


def _picture(found: Mapping[int, Mapping[str, HomeVectors]]) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6), layout="constrained")
    for axes, (count, models) in zip(figure.subplots(1, len(ARRAYS)), found.items(), strict=True):
        its = models["alv"]
        lengths = np.maximum(np.hypot(*its.vectors.T), 1e-12)[:, None]
        axes.quiver(
            *its.points.T, *(its.vectors / lengths).T, color=BELIEVED, pivot="tail", scale=16
        )
        axes.plot(*its.posts.T, "o", color=WALL, ms=7, label="landmark")
        axes.plot(0.0, 0.0, "*", color=HOME, ms=13, label="nest")
        axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)", xlim=(-9, 9), ylim=(-9, 9))
        axes.set_title(f"{count} landmarks: {its.errors.mean():.0f}° off in the mean")
    axes.legend(loc="upper right")
    return figure
