"""Bars of the pointing probes: means of subjects with their intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from albot_core.drawing.palette import BELIEVED, HOME, PARTICLE, TRUTH, WALL
from albot_experiments.pointing_errors import Effect

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_bars(axes: Axes, groups: Mapping[str, Mapping[str, Effect | None]]) -> None:
    """Draw means of subjects with their intervals, a bar for each condition.

    Args:
        axes: Where to draw.
        groups: The effects by condition and subject, in the order of `SUBJECTS`.
    """
    names = list(next(iter(groups.values())))
    at = np.arange(len(names), dtype=np.float64)
    height = 0.8 / len(groups)
    for k, ((condition, effects), colour) in enumerate(
        zip(groups.items(), (TRUTH, BELIEVED, HOME, PARTICLE), strict=False)
    ):
        for row, effect in zip(at, effects.values(), strict=True):
            if effect is None:
                continue
            spread = np.array(((effect.mean - effect.low,), (effect.high - effect.mean,)))
            axes.barh(
                row + (k - (len(groups) - 1) / 2) * height,
                effect.mean,
                height,
                color=colour,
                xerr=spread.clip(0.0),
                error_kw={"lw": 0.8, "ecolor": WALL},
                label=condition if row == at[0] else None,
            )
    axes.set_yticks(at, names)
    axes.invert_yaxis()
