"""The desert ant: the systematic error of its path integration, and its search for the nest."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float64

from albot_core.drawing.palette import BELIEVED, HOME, WALL
from albot_core.evaluation.intervals import bootstrap
from albot_core.geometry.poses import wrap_angle
from albot_core.mappers.sahabot.config import SahabotConfig
from albot_core.mappers.sahabot.mapper import Sahabot
from albot_core.planning.systematic_search import SystematicSearch
from albot_core.sensing.reading import LaserGeometry, LaserScan, Reading
from albot_experiments.report import Figures, Report, each_seed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ID = "ants"
TITLE = "The desert ant: the error of its path integration against the turn, and its search"
TURNS = np.arange(0, 180, 10)
"""Turns between the two legs (degrees)."""
LEGS = (10.0, 5.0)
"""Lengths of the legs (m)."""
STEP = 0.05
"""Length of a step (m)."""
NEST_SIGMA, FOUND = 1.5, 0.3
"""Standard deviation of x and of y of the true nest from where the search begins, and distance at
which the robot would see it (m)."""
CONDITIONS = {
    "path integration": (
        "ants led round a corner, home vectors afterwards",
        f"two legs of {LEGS[0]:g} and {LEGS[1]:g} m, exact readings; `sahabot` with "
        "`integration: approximate`",
    ),
    "search": (
        "ants displaced to ground without landmarks",
        "a point that moves straight from point to point, 20 loops; nothing is in view",
    ),
}
PAPER: Mapping[str, Figures] = {
    "error_as_published": True,
    "error_towards_first_leg": True,
    "search_centred": True,
    "azimuthal_bias": False,
}
MOST_DEVIATION, MOST_BIAS, MOST_OFF_CENTRE = 1.0, 0.1, 0.1
"""Bounds: largest deviation of the error from the published equation's (degrees); length of the
mean direction, from 0 to 1; distance of the search's centre, as a share of its mean distance."""
Path = Float64[np.ndarray, "_ 2"]
"""Points of a path (m), from where the nest should be."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Lead the mapper round corners, and search for the nest once per seed.

    Raises:
        InputError: No seeds.
    """
    return report([search_path(seed) for seed in each_seed(seeds, progress)], seeds)


def believed_direction(turn: float, config: SahabotConfig) -> float:
    """Return the direction of the robot from the nest (rad), as the mapper believes it.

    Args:
        turn: Turn between the two legs (rad).
        config: The mapper's.
    """
    mapper = Sahabot(config)
    laser = LaserScan(ranges=np.full(2, np.inf), geometry=LaserGeometry(beams=2, spacing=np.pi / 2))
    mapper.update(Reading(stamp=0.0, motion=np.zeros(3), laser=laser, compass=0.0))
    ways = [((STEP, 0.0, 0.0), 0.0)] * round(LEGS[0] / STEP)
    ways += [((0.0, 0.0, turn), turn), *[((STEP, 0.0, 0.0), turn)] * round(LEGS[1] / STEP)]
    for motion, heading in ways:
        mapper.update(Reading(stamp=0.0, motion=np.array(motion), laser=laser, compass=heading))
    x, y, _ = mapper.estimate.pose.tolist()
    return math.atan2(y, x)


def published_direction(turn: float) -> float:
    """Return the same by the published equation alone: the oracle, with steps of 1 mm.

    Müller and Wehner (1988): dφ = k (180° - δ)(180° + δ) δ / l and dl = 1 - |δ| / 90°.
    """
    direction, length, degrees = 0.0, LEGS[0], math.degrees(turn)
    for _ in range(round(LEGS[1] / 1e-3)):
        delta = degrees - direction
        direction += 1e-3 * 4.009e-5 * (180.0 - delta) * (180.0 + delta) * delta / length
        length += 1e-3 * (1.0 - abs(delta) / 90.0)
    return math.radians(direction)


def true_direction(turn: float) -> float:
    """Return the true direction from the nest (rad)."""
    return math.atan2(LEGS[1] * math.sin(turn), LEGS[0] + LEGS[1] * math.cos(turn))


def errors_of(direction: Callable[[float], float]) -> Float64[np.ndarray, "turns"]:
    """Return the errors of directions (degrees) at the `TURNS`; positive turns it back too far."""
    return np.array(
        [
            math.degrees(wrap_angle(direction(turn) - true_direction(turn)))
            for turn in np.radians(TURNS)
        ]
    )


def search_path(seed: int) -> Path:
    """Return the path of a search (m), from where the nest should be, in steps of 0.1 m."""
    search = SystematicSearch()
    search.begin(np.random.default_rng(seed))
    path = [np.zeros(2)]
    while not search.is_over:
        to = search.target(path[-1]) - path[-1]
        path.append(path[-1] + to * min(1.0, 0.1 / max(float(np.hypot(*to)), 1e-9)))
    return np.array(path)


def mean_direction(paths: Path) -> float:
    """Return the length of the mean direction from the centre: 0 without a bias, up to 1."""
    distances = np.hypot(*paths.T)
    away = paths[distances > 0.5]
    return float(np.hypot(*(away / np.hypot(*away.T)[:, None]).mean(axis=0)))


def report(paths: Sequence[Path], seeds: range) -> Report:
    """Return the report of errors and searches."""
    exact = errors_of(lambda turn: believed_direction(turn, SahabotConfig()))
    ours = errors_of(
        lambda turn: believed_direction(turn, SahabotConfig(integration="approximate"))
    )
    published = errors_of(published_direction)
    every = np.concatenate(list(paths))
    distances = np.hypot(*every.T)
    off_centre = float(np.hypot(*every.mean(axis=0)) / distances.mean())
    bias = mean_direction(every)
    deviation = float(np.abs(ours - published).max())
    density = ring_density(every)
    measured: dict[str, Figures] = {
        "error_as_published": deviation <= MOST_DEVIATION,
        "error_towards_first_leg": bool((ours[1:] > 0).all()),
        "search_centred": bool(off_centre <= MOST_OFF_CENTRE and (np.diff(density) < 0).all()),
        "azimuthal_bias": bias > MOST_BIAS,
        "largest_error_deg": round(float(ours.max()), 1),
        "at_turn_deg": int(TURNS[ours.argmax()]),
        "largest_deviation_deg": round(deviation, 2),
        "largest_error_of_exact_deg": round(float(np.abs(exact).max()), 6),
        "mean_direction": round(bias, 3),
        "off_centre": round(off_centre, 3),
    }
    found = np.array([is_found(path, seed) for path, seed in zip(paths, seeds, strict=True)])
    low, high = bootstrap(found.astype(float), np.mean, np.random.default_rng(0))
    measured["search"] = {
        "nest_found": round(float(found.mean()), 3),
        "low": round(low, 2),
        "high": round(high, 2),
    }
    measured["density"] = {
        f"{ring}–{ring + 1} m": round(float(share), 4) for ring, share in enumerate(density)
    }
    measured["seeds"] = len(paths)
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=all(measured[name] == value for name, value in PAPER.items()),
        conditions=CONDITIONS,
        text=_text(seeds),
        pictures={"ants": _picture(ours, published, paths[0], every)},
    )


def ring_density(paths: Path) -> Float64[np.ndarray, "rings"]:
    """Return the share of the path per square metre in rings of 1 m around the centre."""
    edges = np.arange(0.0, 8.0)
    counts = np.histogram(np.hypot(*paths.T), edges)[0]
    return np.asarray(counts / len(paths) / (np.pi * np.diff(edges**2)))


def is_found(path: Path, seed: int) -> bool:
    """Return whether a search comes near a nest that lies elsewhere by chance (`NEST_SIGMA`)."""
    nest = np.random.default_rng((seed, 1)).normal(0.0, NEST_SIGMA, 2)
    return bool((np.hypot(*(path - nest).T) < FOUND).any())


def _text(seeds: range) -> str:
    return f"""
Path integration: the robot goes {LEGS[0]:g} m, turns, and goes {LEGS[1]:g} m. The figures compare
where `sahabot` then believes the nest, with the ant's approximate integration, with the equation of
Müller and Wehner (1988) solved by itself, in smaller steps and other code. The thesis's sources say
that such errors occur and "are of the sign and magnitude predicted by the model", and that they
bring the ant "closer to the first and mostly straight leg"; the ants' own angles are not in our
text. `largest_error_deg` is the largest error of the direction home, `at_turn_deg` the turn at
which it occurs, `largest_error_of_exact_deg` that of exact integration.

Search: once for each of the seeds {seeds.start} to {seeds.stop - 1}, 20 loops from the end of the
home vector. `mean_direction` is the length of the mean direction of all points of the paths (0
without a bias, 1 if all lay in one direction), `off_centre` the distance of their centre as a share
of their mean distance, `density` the share of the path per m² in rings. `nest_found` is the share
of searches that come within {FOUND} m of a nest drawn with {NEST_SIGMA} m of standard deviation in
x and in y, with a bootstrapped 95 % interval.

Reached where the error agrees with the equation within {MOST_DEVIATION:g}° at all turns and leads
to the first leg, and where the search is centred within {MOST_OFF_CENTRE:.0%}, falls off from ring
to ring, and has a mean direction of {MOST_BIAS} at most.
"""


def _picture(
    ours: Float64[np.ndarray, "turns"],
    published: Float64[np.ndarray, "turns"],
    path: Path,
    every: Path,
) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 4), layout="constrained")
    error, search, density = figure.subplots(1, 3)
    error.plot(TURNS, published, color=WALL, lw=1.5, label="equation of 1988")
    error.plot(TURNS, ours, "o", color=BELIEVED, ms=5, label="sahabot, approximate")
    error.axhline(0.0, color=HOME, lw=1.0, ls="--", label="exact integration")
    error.set(xlabel="turn between the legs (°)", ylabel="error of the direction home (°)")
    error.legend(loc="upper left", fontsize=8)
    search.plot(*path.T, color=BELIEVED, lw=0.8)
    search.plot(0.0, 0.0, "*", color=HOME, ms=10, label="end of the home vector")
    search.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    search.legend(loc="upper right", fontsize=8)
    density.bar(np.arange(7) + 0.5, ring_density(every), width=0.9, color=BELIEVED)
    density.set(xlabel="distance from the centre (m)", ylabel="share of the path per m²")
    return figure
