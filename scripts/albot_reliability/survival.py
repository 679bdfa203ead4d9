"""The section on faults on purpose: which mappers survive them, and what is promised."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from albot_env.faults.registry import FAULTS
from albot_studies.fault_survival import MAPPERS, figures, measure_all, page

SEEDS = range(1000, 1020)
"""Seeds of the worlds; the mappers' thresholds were set on others."""


def measure(share: float, _: Mapping[str, Any]) -> dict[str, Any]:
    """Let all faults strike all mappers in a share of the worlds."""
    seeds = SEEDS[: max(1, round(share * len(SEEDS)))]
    runs = measure_all(tuple(FAULTS), MAPPERS, seeds)
    measured = figures(runs, seeds)
    return {name: found for name, found in measured.items() if name != "runs"}


def render(measured: Mapping[str, Any]) -> Iterable[str]:
    """Yield the lines of the section."""
    yield from page(measured, "albot experiment study fault-survival").splitlines()
