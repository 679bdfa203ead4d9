"""FastSLAM's consistency: does its error stay within the uncertainty that it believes in?"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from jaxtyping import Float64

from albot_core.drawing.palette import BELIEVED, HOME, PARTICLE, RULE, SERIES, TRUTH, WALL
from albot_core.geometry.poses import compose, relative, transform_points, wrap_angle
from albot_core.geometry.types import Points, Pose, Poses
from albot_core.mappers.slam.fastslam_config import FastSlamConfig
from albot_core.mappers.slam.landmark_particles import LandmarkParticles, Landmarks
from albot_core.mappers.slam.line_ends import SeenLandmarks
from albot_experiments.report import Figures, Report, Scalar, each_seed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ID = "fastslam-consistency"
TITLE = "FastSLAM's error against the uncertainty that it believes in (Bailey et al. 2006)"
RADIUS, STEP, LAPS = 25.0, 1.0, 2
"""Radius of the robot's circle, length of a step (m), and number of laps."""
LANDMARKS, APART, ASIDE, REACH = 40, 4.0, 15.0, 20.0
"""Number of point landmarks, their least distance from each other, their largest from the circle,
and the sensor's reach (m); it looks ahead by 180°."""
RANGE_NOISE, BEARING_NOISE = 0.1, math.radians(1.0)
"""Standard deviations of ranges (m) and bearings (rad)."""
MOTION_NOISE = np.array((0.05, 0.05, math.radians(1.0)))
"""Standard deviations of a step along the robot's axes (m, m, rad)."""
FIRST = 30.0
"""Way at whose end the filter should still be consistent (m)."""
GATE, NEW_LANDMARK = 13.8, 1e-4
"""The filter's gate (chi-square of two numbers at 99.9 %) and likelihood of a new landmark (1/m²):
here, other than in a building, nothing is seen that is no landmark."""
SHARE = 0.95
"""Probability of the chi-square interval."""
BEFORE, AFTER = 0.8, 1.1
"""When the particles' paths are drawn: before the first loop is closed and after it (laps)."""
_LAP = round(2.0 * math.pi * RADIUS / STEP)
"""Number of steps of a lap."""


@dataclass(frozen=True, kw_only=True)
class Variant:
    """A filter that is judged."""

    particles: int = FastSlamConfig.particles
    proposal: Literal["landmarks", "motion"] = FastSlamConfig.proposal
    noise: float = 1.0
    """Noise of the landmarks that the filter is told, as a multiple of the true one."""


VARIANTS: Mapping[str, Variant] = {
    "fastslam, 100 particles": Variant(),
    "fastslam, 20 particles": Variant(particles=20),
    "fastslam, 500 particles": Variant(particles=500),
    "fastslam, 3000 particles": Variant(particles=3000),
    "FastSLAM 1.0, 500 particles": Variant(particles=500, proposal="motion"),
    "500 particles, told half the noise": Variant(particles=500, noise=0.5),
}
OURS, FEW, MORE, MOST, _, WRONG = VARIANTS
CONDITIONS = {
    "environment": (
        "point landmarks in simulation",
        f"{LANDMARKS} point landmarks within {ASIDE:g} m of a circle of {2 * RADIUS:g} m, at "
        f"least {APART:g} m apart, drawn anew for each seed",
    ),
    "path": ("loops", f"{LAPS} laps, {LAPS * _LAP * STEP:.0f} m"),
    "sensor": (
        "range and bearing of landmarks; in the authors' simulator 0.1 m and 1°",
        f"{RANGE_NOISE} m and {math.degrees(BEARING_NOISE):.0f}°, up to {REACH:g} m, 180° ahead",
    ),
    "motion": (
        "known noise",
        f"steps of {STEP:g} m, with errors of {MOTION_NOISE[0]} m and "
        f"{math.degrees(MOTION_NOISE[2]):.0f}°, known to the filter",
    ),
    "association": (
        "not stated in the abstract",
        "by maximum likelihood, as `fastslam` does, with a gate of 99.9 %",
    ),
}
PAPER: Mapping[str, Figures] = {
    "consistent_at_first": True,
    "optimistic_in_the_end": True,
    "longer_with_more_particles": True,
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Drive:
    """A robot's drive among landmarks, as it was and as it was sensed."""

    landmarks: Points
    """The true landmarks (m)."""
    truth: Poses
    """True poses (steps + 1, 3), from the origin on."""
    motions: Float64[np.ndarray, "steps 3"]
    """The motions that were commanded and are reported, (steps, 3)."""
    seen: Sequence[Float64[np.ndarray, "_ 2"]]
    """Ranges (m) and bearings (rad) of the landmarks in view, at each pose."""


ParticlePoses = Float64[np.ndarray, "_ _ 3"]
"""The path of each particle: (particles, steps, 3)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Belief:
    """What a filter believed on a drive."""

    nees: Float64[np.ndarray, "steps"]
    """Normalised estimation error squared of the pose, after each step."""
    errors: Float64[np.ndarray, "steps"]
    """Distance of the mean pose from the true one (m)."""
    poses: Float64[np.ndarray, "particles 3"]
    """The particles at the end."""
    landmarks: Landmarks
    """The best particle's landmarks at the end."""
    path: Float64[np.ndarray, "steps 3"]
    """The mean poses."""
    loop: tuple[ParticlePoses, ParticlePoses]
    """The paths of all particles at `BEFORE` and at `AFTER`."""


def run(seeds: range, progress: Callable[[int], None] = lambda done: None) -> Report:
    """Drive once per seed, and filter what is sensed by each variant.

    Raises:
        InputError: No seeds.
    """
    beliefs: dict[str, list[Belief]] = {name: [] for name in VARIANTS}
    drives = []
    for seed in each_seed(seeds, progress):
        drives.append(drive(seed))
        for name, variant in VARIANTS.items():
            beliefs[name].append(believe(drives[-1], variant, seed))
    return report(beliefs, drives[0], seeds)


def drive(seed: int) -> Drive:
    """Return the drive of a seed."""
    rng = np.random.default_rng(seed)
    landmarks = _drawn_landmarks(rng)
    motion = np.array((STEP, 0.0, STEP / RADIUS))
    truth = [np.zeros(3)]
    for _ in range(LAPS * _LAP):
        error = MOTION_NOISE * rng.standard_normal(3)
        truth.append(compose(compose(truth[-1], motion), error))
    seen = [_sense(pose, landmarks, rng) for pose in truth]
    motions = np.tile(motion, (LAPS * _LAP, 1))
    return Drive(landmarks=landmarks, truth=np.array(truth), motions=motions, seen=seen)


def _drawn_landmarks(rng: np.random.Generator) -> Points:
    """Return landmarks around the circle, which the robot drives to the left."""
    kept: list[np.ndarray] = []
    while len(kept) < LANDMARKS:
        angle, radius = rng.uniform(0.0, 2.0 * math.pi), RADIUS + rng.uniform(-ASIDE, ASIDE)
        point = np.array((radius * math.cos(angle), RADIUS + radius * math.sin(angle)))
        if all(np.hypot(*(point - other)) >= APART for other in kept):
            kept.append(point)
    return np.array(kept)


def _sense(pose: Pose, landmarks: Points, rng: np.random.Generator) -> Float64[np.ndarray, "_ 2"]:
    """Return ranges and bearings of the landmarks in view of a pose."""
    points = transform_points(relative(pose, np.zeros(3)), landmarks)
    ranges, bearings = np.hypot(*points.T), np.arctan2(points[:, 1], points[:, 0])
    exact = np.column_stack((ranges, bearings))
    in_view = exact[(ranges < REACH) & (np.abs(bearings) < math.pi / 2)]
    noise = np.array((RANGE_NOISE, BEARING_NOISE))
    return np.asarray(in_view + noise * rng.standard_normal(in_view.shape))


def as_points(seen: Float64[np.ndarray, "_ 2"], noise: float) -> SeenLandmarks:
    """Return ranges and bearings as points with covariances, for a multiple of the noise."""
    ranges, bearings = seen.T
    cos, sin = np.cos(bearings), np.sin(bearings)
    along = (noise * RANGE_NOISE) ** 2
    across = (noise * BEARING_NOISE * ranges) ** 2
    return np.column_stack(
        (
            ranges * cos,
            ranges * sin,
            cos * cos * along + sin * sin * across,
            cos * sin * (along - across),
            sin * sin * along + cos * cos * across,
        )
    )


def believe(journey: Drive, variant: Variant, seed: int) -> Belief:
    """Return what a filter believes on a drive; its random numbers are those of the seed."""
    config = FastSlamConfig(
        particles=variant.particles,
        proposal=variant.proposal,
        gate=GATE,
        new_landmark=NEW_LANDMARK,
    )
    particles, rng = LandmarkParticles(config), np.random.default_rng((seed, 1))
    nees, errors, path, loop = [], [], [], []
    for k, (true, seen) in enumerate(zip(journey.truth, journey.seen, strict=True)):
        particles.observe(as_points(seen, variant.noise))
        if k:
            noise = rng.standard_normal((variant.particles, 3))
            particles.move_and_weigh(journey.motions[k - 1], MOTION_NOISE, noise)
        particles.update_landmarks()
        particles.remember()
        weights = particles.weights()
        if k:
            mean, spread = moments(particles.poses, weights)
            error = true - mean
            error[2] = wrap_angle(error[2])
            nees.append(float(error @ np.linalg.solve(spread, error)))
            errors.append(float(np.hypot(*error[:2])))
            path.append(mean)
        if 1.0 / np.sum(weights**2) < config.resample_below * variant.particles:
            particles.resample(weights, rng)
        if k in (round(BEFORE * _LAP), round(AFTER * _LAP)):
            loop.append(np.array([particles.trajectory(n) for n in range(variant.particles)]))
    before, after = loop
    return Belief(
        nees=np.array(nees),
        errors=np.array(errors),
        poses=particles.poses.copy(),
        landmarks=particles.landmarks_of(particles.best),
        path=np.array(path),
        loop=(before, after),
    )


def moments(
    poses: Poses, weights: Float64[np.ndarray, "particles"]
) -> tuple[Pose, Float64[np.ndarray, "3 3"]]:
    """Return mean and covariance of weighted poses; the heading's are those around its mean."""
    heading = math.atan2(weights @ np.sin(poses[:, 2]), weights @ np.cos(poses[:, 2]))
    mean = np.array((*(weights @ poses[:, :2]), heading))
    off = poses - mean
    off[:, 2] = wrap_angle(off[:, 2])
    # A floor far below any real spread: one particle alone has none.
    return mean, (weights[:, None] * off).T @ off + 1e-12 * np.eye(3)


def interval(runs: int) -> tuple[float, float]:
    """Return the interval of the mean NEES of a consistent filter over so many runs.

    The sum over runs is distributed as chi-square with three degrees of freedom a run (Bar-Shalom,
    Li and Kirubarajan, Estimation with applications to tracking and navigation, 2001, section 5.4).
    """
    from scipy.stats import chi2  # slow to load

    low, high = chi2.ppf(((1.0 - SHARE) / 2.0, (1.0 + SHARE) / 2.0), 3 * runs) / runs
    return float(low), float(high)


def consistent_way(nees: Float64[np.ndarray, "steps"], most: float) -> float:
    """Return the way after which the mean NEES has left the interval upwards for good (m)."""
    inside = np.flatnonzero(nees <= most)
    return STEP * float(inside[-1] + 1) if len(inside) else 0.0


def report(beliefs: Mapping[str, Sequence[Belief]], first: Drive, seeds: range) -> Report:
    """Return the report of the filters' beliefs; `first` is the drive that is drawn."""
    low, high = interval(len(seeds))
    begin = round(FIRST / STEP)
    curves = {name: np.mean([b.nees for b in some], axis=0) for name, some in beliefs.items()}
    groups: dict[str, dict[str, Scalar]] = {
        name: {
            "particles": VARIANTS[name].particles,
            "nees_first": round(float(nees[:begin].mean()), 2),
            "nees_last_lap": round(float(nees[-_LAP:].mean()), 1),
            "consistent_m": round(consistent_way(nees, high), 0),
            "median_end_error_m": round(
                float(np.median([belief.errors[-1] for belief in beliefs[name]])), 2
            ),
        }
        for name, nees in curves.items()
    }
    at_first = {name: low <= float(n[:begin].mean()) <= high for name, n in curves.items()}
    is_optimistic = all(float(nees[-_LAP:].mean()) > high for nees in curves.values())
    ways = [consistent_way(curves[name], high) for name in (FEW, OURS, MORE, MOST)]
    is_longer = ways == sorted(ways) and ways[0] < ways[-1]
    histories = np.array([[_histories(paths) for paths in b.loop] for b in beliefs[OURS]])
    found = {
        "consistent_at_first": at_first[MOST],
        "optimistic_in_the_end": is_optimistic,
        "longer_with_more_particles": is_longer,
    }
    measured: dict[str, Figures] = {
        **found,
        "histories_before": round(float(histories[:, 0].mean()), 1),
        "histories_after": round(float(histories[:, 1].mean()), 1),
        "interval_low": round(low, 2),
        "interval_high": round(high, 2),
        "seeds": len(seeds),
        **groups,
    }
    holds = all(found.values()) and not at_first[WRONG]
    return Report(
        id=ID,
        title=TITLE,
        paper=PAPER,
        measured=measured,
        holds=holds,
        verdicts={MOST: holds, OURS: at_first[OURS], WRONG: at_first[WRONG]},
        conditions=CONDITIONS,
        text=_text(seeds, low, high),
        pictures={
            "nees": _picture(curves, (low, high), first, beliefs[OURS][0]),
            "loop": _loop_picture(first, beliefs[OURS][0]),
        },
    )


def _histories(paths: ParticlePoses) -> int:
    """Return how many different poses the particles have for the time of a tenth of a lap."""
    return len(np.unique(paths[:, round(0.1 * _LAP)], axis=0))


def _text(seeds: range, low: float, high: float) -> str:
    return f"""
A robot drives {LAPS} laps of a circle among point landmarks, once for each of the seeds
{seeds.start} to {seeds.stop - 1}. The filter of the mapper `fastslam` knows the noise of its motion
and of its sensor, and nothing else. `nees` is the normalised estimation error squared of its pose,
(x - x̂)ᵀ P⁻¹ (x - x̂), with the mean x̂ and the covariance P of the weighted particles, in the mean
over all seeds. A consistent filter has 3, and is within {low:.2f} to {high:.2f} at a moment with a
probability of {SHARE:.0%} (chi-square, {3 * len(seeds)} degrees of freedom). Above it the filter is
optimistic: its errors are larger than it believes.

Bailey, Nieto and Nebot (*Consistency of the FastSLAM algorithm*, ICRA 2006) find that FastSLAM may
be consistent in the short term, and is always optimistic in the long term, with any number of
particles: each resampling takes histories from the particles for good. `nees_first` is over the
first {FIRST:g} m, `nees_last_lap` over the last lap, and `consistent_m` the way after which the
mean NEES has left the interval upwards for good.

The second picture is as the thesis's figure 2.8 (after Hähnel et al. 2003): the paths of all
{VARIANTS[OURS].particles} particles shortly before the first loop is closed, and shortly after.
`histories_before` and `histories_after` say how many different poses they then have for the time of
a tenth of the first lap, in the mean over all seeds.

Reached where {VARIANTS[MOST].particles} particles are within the interval over the first
{FIRST:g} m, all filters are above it in the last lap, and the more particles there are, the longer
they are in it, while the filter that is told half of the landmarks' noise is not within it even at
first. The other verdicts are whether a filter is within it over the first {FIRST:g} m: the mapper's
default number of particles is not enough for that, and a wrong noise must not be. World, noise and
numbers of particles were chosen on other seeds.
"""


def _picture(
    curves: Mapping[str, Float64[np.ndarray, "steps"]],
    band: tuple[float, float],
    journey: Drive,
    belief: Belief,
) -> Figure:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.5, 5.6), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.3))
    _draw_world(left, journey, belief)
    for (name, nees), colour in zip(curves.items(), SERIES, strict=False):
        style = ":" if name == WRONG else "-"
        ways = STEP * np.arange(1, len(nees) + 1)
        right.plot(ways, nees, style, color=colour, lw=1.3, label=name)
    right.axhspan(*band, color=RULE, zorder=0, label=f"consistent ({SHARE:.0%})")
    right.axhline(3.0, color=WALL, lw=0.8, ls="--")
    right.axvline(_LAP * STEP, color=WALL, lw=0.8, ls=":")
    right.text(_LAP * STEP, 1.1, " second lap", color=WALL, fontsize=9)
    right.set(yscale="log", xlabel="way (m)", ylabel="mean NEES of the pose", xlim=(0, None))
    right.set_ylim(1.0, 1e5)
    right.legend(loc="lower right", fontsize=8)
    return figure


def _loop_picture(journey: Drive, belief: Belief) -> Figure:
    """Draw the paths of all particles before and after the first loop is closed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 6.6), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    titles = "shortly before closing the loop", "shortly after it"
    for axes, title, paths in zip(panels, titles, belief.loop, strict=True):
        for k, path in enumerate(paths):
            axes.plot(
                *path[:, :2].T, color=BELIEVED, lw=0.4, label="" if k else "path of a particle"
            )
        true = journey.truth[: paths.shape[1]]
        axes.plot(*true[:, :2].T, color=TRUTH, lw=1.4, label="true path")
        axes.plot(*journey.landmarks.T, "+", color=WALL, ms=7, label="true landmark")
        axes.plot(*true[0, :2], "o", color=HOME, ms=6, ls="none", label="start")
        axes.set(aspect="equal", xlabel="x (m)", title=title)
    panels[0].set_ylabel("y (m)")
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _draw_world(axes: Axes, journey: Drive, belief: Belief) -> None:
    """Draw a drive, and the landmarks as they are believed at its end."""
    axes.plot(*journey.truth[:, :2].T, color=TRUTH, lw=1.2, label="true path")
    axes.plot(*belief.path[:, :2].T, "--", color=BELIEVED, lw=1.2, label="mean of the particles")
    axes.plot(*journey.landmarks.T, "+", color=WALL, ms=8, label="true landmark")
    axes.plot(*belief.landmarks.points.T, ".", color=HOME, ms=4, label="landmark, 3σ")
    angles = np.linspace(0.0, 2.0 * math.pi, 40)
    circle = np.column_stack((np.cos(angles), np.sin(angles)))
    for point, spread in zip(belief.landmarks.points, belief.landmarks.covariances, strict=True):
        ellipse = point + 3.0 * circle @ np.linalg.cholesky(spread).T
        axes.plot(*ellipse.T, color=HOME, lw=0.8)
    axes.plot(*belief.poses[:, :2].T, ".", color=PARTICLE, ms=3, label="particles at the end")
    axes.set(aspect="equal", xlabel="x (m)", ylabel="y (m)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=3, fontsize=8, frameon=False)
