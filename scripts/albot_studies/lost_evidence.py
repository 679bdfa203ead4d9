"""Fit of the weights by which Albot1 judges where a robot that was carried away may be.

Robots are carried away as in `kidnapped-robots`, N times in each world, and are never allowed to
relocalise. Every comparison with known places is an example: its hypotheses, and which of them are
right. None is right if the robot is on unknown ground. The weights are those for which the right
hypotheses are the most probable. Comparisons of one robot are similar, so they have a total weight
of 1. The weights are the constants of `albot_core.mappers.albot1.places.hypothesis`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import click
import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import minimize

from albot_agents.evaluation.plan import parse_seeds
from albot_cli.number_types import CountType
from albot_core.errors import InputError
from albot_core.geometry.poses import compose, relative, wrap_angle
from albot_core.geometry.types import Pose
from albot_core.mappers.albot1.config import Albot1Config
from albot_core.mappers.albot1.mapper import Albot1
from albot_core.mappers.albot1.places.hypothesis import Hypothesis
from albot_core.mappers.albot1.places.relocalisation import MOST
from albot_env.sim.simulator import Simulator
from albot_maps import World, load_world
from albot_studies.kidnapped_robots import AFTER, BEFORE, SOON, moved_after

WORLDS = (
    "random:office:SEED?rooms=8",
    "random:apartment:SEED",
    "random:hall:SEED",
    "random:maze:SEED",
    "random:ring:SEED",
    "random:warehouse:SEED",
)
WEIGHTS = "prior", "of match", "of share", "of missing", "of across"
RIGHT, TURN = 1.5, np.radians(20.0)
"""A hypothesis is right if the errors of the robot's position (m) and heading (rad) are below
these."""
NEVER = 1_000_000
"""More surfaces than any place has: a robot that needs this number stays lost."""
RIDGE = 1e-3
"""Penalty of the squares of the weights."""
BARS = 0.5, 0.8, 0.9, 0.95, 0.99


@dataclass(frozen=True, kw_only=True, eq=False)
class Examples:
    """Comparisons of what lost robots have seen with known places."""

    features: Float64[np.ndarray, "examples hypotheses 5"]
    """For each hypothesis: 1, matches, share, and the two contradictions; NaN for no hypothesis."""
    right: Bool[np.ndarray, "examples hypotheses"]
    """Which hypotheses are right."""
    count: Float64[np.ndarray, "examples"]
    """The weight of each example."""


def gather(worlds: tuple[str, ...], seeds: range, repeats: int) -> Examples:
    """Carry robots away in all worlds, and collect their comparisons."""
    runs = [
        _compared(load_world(spec.replace("SEED", str(seed))), seed, repeat)
        for spec in worlds
        for seed in seeds
        for repeat in range(repeats)
    ]
    rows = [row for run in runs for row in run]
    if not rows:
        raise InputError("--seeds", "worlds in which robots notice", f"{worlds} {seeds}")
    return Examples(
        features=np.array([features for features, _ in rows]),
        right=np.array([right for _, right in rows]),
        count=np.array([1.0 / len(run) for run in runs for _ in run]),
    )


def _compared(world: World, seed: int, repeat: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the comparisons of one robot: its hypotheses' features, and which are right."""
    places = replace(Albot1Config().places, min_relocalise_matches=NEVER)
    mapper = Albot1(replace(Albot1Config(), places=places))
    rng = np.random.default_rng([seed, repeat])
    count, simulator = int(rng.integers(*BEFORE)), Simulator(world, movables=False)
    rows = []
    for k, reading in enumerate(moved_after(count, simulator, rng, AFTER)):
        before = mapper.hypotheses
        mapper.update(reading)
        if k < count and not mapper.estimate.localised:
            return []  # A false alarm.
        if k == count + SOON and mapper.estimate.localised:
            return []  # Not noticed.
        if k >= count and mapper.hypotheses and mapper.hypotheses is not before:
            true = relative(world.starts[0], simulator.pose)
            features, right = np.full((MOST, 5), np.nan), np.zeros(MOST, np.bool_)
            for row, one in enumerate(mapper.hypotheses):
                against = one.missing, float(one.across)
                features[row] = 1.0, one.match.matches, one.match.share, *against
                right[row] = _is_right(one, mapper, true)
            rows.append((features, right))
    return rows


def _is_right(one: Hypothesis, mapper: Albot1, true: Pose) -> bool:
    network = mapper.network
    assert network.home is not None
    home = compose(one.map_to_graph, network.place(network.home).frame)
    believed = relative(home, mapper.estimate.pose)
    away = float(np.hypot(*(believed - true)[:2]))
    return away < RIGHT and abs(wrap_angle(believed[2] - true[2])) < TURN


def probabilities(
    examples: Examples, weights: Float64[np.ndarray, "5"]
) -> Float64[np.ndarray, "examples hypotheses"]:
    """Return the probability of each hypothesis; 0 for no hypothesis."""
    odds = np.exp(np.nan_to_num(examples.features @ weights, nan=-np.inf))
    return np.asarray(odds / (1.0 + odds.sum(axis=1, keepdims=True)))


def fit(examples: Examples) -> Float64[np.ndarray, "5"]:
    """Return the weights for which the right hypotheses are the most probable."""
    features = np.nan_to_num(examples.features)
    is_none = ~examples.right.any(axis=1)

    def loss(weights: np.ndarray) -> tuple[float, np.ndarray]:
        expected = probabilities(examples, weights)
        hit = np.where(examples.right, expected, 0.0)
        total = np.where(is_none, 1.0 - expected.sum(axis=1), hit.sum(axis=1))
        total = np.maximum(total, 1e-12)
        posterior = hit / total[:, None]
        gradient = np.einsum("i,ij,ijk->k", examples.count, expected - posterior, features)
        value = -float(examples.count @ np.log(total)) + RIDGE * weights @ weights
        return value, gradient + 2.0 * RIDGE * weights

    return np.asarray(minimize(loss, np.zeros(5), jac=True, method="BFGS").x)


@click.command()
@click.option("--worlds", multiple=True, default=WORLDS, help="The worlds; SEED stands for each.")
@click.option("--seeds", default="7000..7014", show_default=True)
@click.option("--repeats", default=4, show_default=True, type=CountType(1))
def command(worlds: tuple[str, ...], seeds: str, repeats: int) -> None:
    """Print the weights, and how often the likeliest hypothesis is right."""
    examples = gather(worlds, parse_seeds(seeds), repeats)
    weights = fit(examples)
    for name, weight in zip(WEIGHTS, weights.tolist(), strict=True):
        click.echo(f"{name}: {weight:.2f}")
    found = probabilities(examples, weights)
    likeliest = np.arange(len(found)), found.argmax(axis=1)
    for bar in BARS:
        probable = found[likeliest] >= bar
        right = int((probable & examples.right[likeliest]).sum())
        click.echo(f"at {bar}: {right} of {probable.sum()} comparisons right")
