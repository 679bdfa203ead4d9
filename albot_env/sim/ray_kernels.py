"""Compiled inner loops of the ray caster. Shapes and meaning: see `rays`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True)
def scan_all(
    walls: np.ndarray,
    cos: np.ndarray,
    sin: np.ndarray,
    reach: float,
    mount: np.ndarray,
    poses: np.ndarray,
    ranges: np.ndarray,
) -> None:
    """Cast every beam of every pose against every wall."""
    for i in range(poses.shape[0]):
        ch, sh = math.cos(poses[i, 2]), math.sin(poses[i, 2])
        x = poses[i, 0] + ch * mount[0] - sh * mount[1]
        y = poses[i, 1] + sh * mount[0] + ch * mount[1]
        ch, sh = math.cos(poses[i, 2] + mount[2]), math.sin(poses[i, 2] + mount[2])
        for k in range(cos.shape[0]):
            dx = ch * cos[k] - sh * sin[k]
            dy = sh * cos[k] + ch * sin[k]
            nearest = np.inf
            for j in range(walls.shape[0]):
                ax, ay = walls[j, 0] - x, walls[j, 1] - y
                bx, by = walls[j, 2] - x, walls[j, 3] - y
                side_a = dx * ay - dy * ax
                side_b = dx * by - dy * bx
                if side_a * side_b <= 0.0 and side_a != side_b:
                    r = (ax * by - ay * bx) / (side_b - side_a)
                    if 0.0 < r < nearest:
                        nearest = r
            ranges[i, k] = nearest if nearest < reach else np.inf
