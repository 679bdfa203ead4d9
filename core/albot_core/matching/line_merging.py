"""Merging of the lines of a place's description with new lines of the same place."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.kernels.compiled import kernel
from albot_core.matching.line_matching import MatchConfig
from albot_core.matching.line_pairs import MatchLimits
from albot_core.matching.lines import beside, describe_all, wrap

REPLACED_FROM = 0.8
"""A new line replaces a remembered one if it has at least this share of its length."""


def merge_lines(
    old: Float64[np.ndarray, "old 4"], new: Float64[np.ndarray, "new 4"], config: MatchConfig
) -> Float64[np.ndarray, "both 4"]:
    """Return the lines of a description merged with new ones, all in one frame (m).

    Of two matching lines the new one is kept, unless it is much shorter.
    """
    old_rows, new_rows = np.empty((len(old), 8)), np.empty((len(new), 8))
    describe_all(np.ascontiguousarray(old), 0.0, old_rows)
    describe_all(np.ascontiguousarray(new), 0.0, new_rows)
    keep_old, keep_new = np.ones(len(old), np.bool_), np.ones(len(new), np.bool_)
    _merge(old_rows, new_rows, config.limits, keep_old, keep_new)
    return np.concatenate((old[keep_old], new[keep_new]))


@kernel()
def _merge(
    old: np.ndarray,
    new: np.ndarray,
    limits: MatchLimits,
    keep_old: np.ndarray,
    keep_new: np.ndarray,
) -> None:
    for q in range(new.shape[0]):
        ends = new[q, 0], new[q, 1], new[q, 2], new[q, 3]
        for k in range(old.shape[0]):
            if not keep_old[k] or abs(wrap(new[q, 5] - old[k, 5])) >= 2 * limits.max_angle:
                continue
            if beside(old[k], ends, new[q, 4]) >= limits.max_gap:
                continue
            if new[q, 4] >= REPLACED_FROM * old[k, 4]:
                keep_old[k] = False
            else:
                keep_new[q] = False
