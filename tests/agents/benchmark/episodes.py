"""Made-up results for tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from albot_agents.benchmark.cell import Cell, EpisodeResult
from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.protocol import find_protocol

PROTOCOL = find_protocol()


def cell(agent: str = "albot1-homing", **changes: Any) -> Cell:
    """A cell of homing in offices."""
    usual = {"task": "Albot/Homing-v0", "mapper": "albot1", "odometer": "pioneer"}
    return Cell(agent=agent, **{**usual, "worlds": "offices", **changes})


def results(
    of: Cell,
    count: int,
    spl: float = 0.5,
    *,
    fingerprint: str | None = None,
    sources: str = "0123456789abcdef",
) -> CellResults:
    """The first episodes of a cell, with made-up figures."""
    keys = PROTOCOL.keys(of.task, of.worlds)[:count]
    episodes = [
        EpisodeResult(
            agent=of.agent,
            world=key.world,
            seed=key.seed,
            steps=10 + k,
            start=np.array([0.1 + k, 2.0, 0.3]),
            begin=np.array([1.0, 2.0, 1 / 3]),
            driven=5.0,
            collisions=k % 2,
            rooms=0,
            coverage_auc=None,
            info={
                "is_success": k % 4 > 0,
                "spl": spl,
                "soft_spl": spl,
                "distance_home": None,
                "position_error": 0.1,
            },
        )
        for k, key in enumerate(keys)
    ]
    return CellResults(cell=of, fingerprint=fingerprint, sources=sources, episodes=episodes)
