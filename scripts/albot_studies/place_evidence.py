"""Fit of the weights by which Albot1 judges whether two places are one.

The drives are those of `room-confusions`, in other worlds, `random:KIND:SEED`. Every comparison of
two places whose structure matches is an example, and the truth is the same as there. The weights
are fitted by logistic regression; the misfit counts by `log_likelihood`, which is not fitted.
Comparisons of the same two places are similar: n of them have the weight of the square root of n.
The weights are the constants of `albot_core.mappers.albot1.places.evidence`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import click
import numpy as np
from jaxtyping import Bool, Float64

from albot_agents.evaluation.plan import parse_seeds
from albot_core.errors import InputError
from albot_core.mappers.albot1.places.evidence import log_likelihood
from albot_studies.room_confusions import comparisons, drive_all

WEIGHTS = "prior", "of share", "of nearest", "of visit"
ROUNDS = 30
"""Number of Newton steps; they converge within ten."""
RIDGE = 0.1
"""Penalty of the squares of the weights."""
BARS = 0.5, 0.8, 0.9, 0.95


@dataclass(frozen=True, kw_only=True, eq=False)
class Examples:
    """Comparisons of places, and whether they were the same."""

    features: Float64[np.ndarray, "examples 4"]
    """1, and the shares that `Evidence` holds."""
    offset: Float64[np.ndarray, "examples"]
    """The misfit's contribution to the log odds."""
    same: Bool[np.ndarray, "examples"]
    """Whether the two places truly are the same."""
    count: Float64[np.ndarray, "examples"]
    """The weight of each example."""


def gather(kind: str, seeds: range, path: float) -> Examples:
    """Drive through all worlds, and collect the comparisons."""
    rows, pairs = [], []
    for seed, driven, same in drive_all(kind, seeds, path, "albot1"):
        for event, share in comparisons(driven, same):
            if event.probability > 0.0:
                shares = event.share, event.nearest_in_sight, event.visit_in_sight
                rows.append((1.0, *shares, log_likelihood(event.misfit), float(share >= 0.5)))
                pairs.append((seed, event.place, event.other))
    if not rows:
        raise InputError("--seeds", "worlds in which places are compared", f"{kind} {seeds}")
    counted, table = Counter(pairs), np.array(rows)
    return Examples(
        features=table[:, :4],
        offset=table[:, 4],
        same=table[:, 5] > 0.5,
        count=np.array([counted[pair] ** -0.5 for pair in pairs]),
    )


def fit(examples: Examples) -> Float64[np.ndarray, "4"]:
    """Return the weights for which the examples are the most probable (Newton's method)."""
    x, weights = examples.features, np.zeros(4)
    penalty = RIDGE * np.diag((0.0, 1.0, 1.0, 1.0))
    for _ in range(ROUNDS):
        expected = _probabilities(examples, weights)
        gradient = x.T @ (examples.count * (examples.same - expected)) - penalty @ weights
        spread = examples.count * expected * (1.0 - expected)
        weights = weights + np.linalg.solve((x * spread[:, None]).T @ x + penalty, gradient)
    return weights


def _probabilities(
    examples: Examples, weights: Float64[np.ndarray, "4"]
) -> Float64[np.ndarray, "examples"]:
    return np.asarray(1.0 / (1.0 + np.exp(-(examples.features @ weights + examples.offset))))


@click.command()
@click.option("--kind", default="office", show_default=True, help="Kind of the random worlds.")
@click.option("--seeds", default="6000..6399", show_default=True)
@click.option("--path", default=300.0, show_default=True, help="Length of each drive (m).")
def command(kind: str, seeds: str, path: float) -> None:
    """Print the weights, and how many examples are accepted above some probabilities."""
    if not path > 0:
        raise InputError("--path", "above 0", str(path))
    examples = gather(kind, parse_seeds(seeds), path)
    weights = fit(examples)
    for name, weight in zip(WEIGHTS, weights.tolist(), strict=True):
        click.echo(f"{name}: {weight:.2f}")
    probable = _probabilities(examples, weights)
    for bar in BARS:
        right, wrong = (int((probable[examples.same == same] >= bar).sum()) for same in (1, 0))
        click.echo(f"at {bar}: {right} of {examples.same.sum()} right, {wrong} wrong")
