"""Film episodes: in a video, simulated time runs at a chosen speed."""

from __future__ import annotations

from collections.abc import Callable
from math import ceil
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import UInt8

from albot_cli.outputs import check_file
from albot_cli.watch import LONGEST_STEP
from albot_env.rendering.video import VideoWriter, check_video_name

LAST = 1.0
"""Time for which the last picture stays (s)."""
_EXACT = 1e-6
"""Share of a picture's time below which rounding errors of the clock do not matter."""
Painter = Callable[[], UInt8[np.ndarray, "h w 3"]]
"""Paints a moment, which may be over by then."""


@runtime_checkable
class Filmed(Protocol):
    """What goes on in steps: one episode or several."""

    @property
    def over(self) -> bool:
        """Whether this is the last moment."""

    @property
    def time(self) -> float:
        """Simulated time since the beginning (s)."""

    def advance(self) -> None:
        """Go to the next moment; do nothing at the last one."""


def check_video(path: Path | None, *, force: bool = False) -> None:
    """Raise InputError if a video is no MP4 or GIF, cannot be made here, or as `check_file` does.

    Args:
        path: The video; None for no video.
        force: Whether the file may exist.
    """
    if path is not None:
        check_video_name(path, "--video")
        check_file(path, force=force)


def film(
    filmed: Filmed,
    video: VideoWriter,
    capture: Callable[[], Painter],
    *,
    speed: float,
    update: Callable[[], None] = lambda: None,
) -> None:
    """Film to the end: each picture shows the latest moment at its time; the last one stays.

    A step that takes long, as on a guided tour, lasts `LONGEST_STEP` at most.

    Args:
        filmed: What goes on.
        video: Where the pictures go.
        capture: Returns what paints the present moment.
        speed: How many times faster than real time simulated time runs.
        update: Called after each step.
    """
    shown = 0.0
    while not filmed.over:
        paint, before = capture(), filmed.time
        filmed.advance()
        update()
        shown += min(filmed.time - before, LONGEST_STEP) / speed
        lasts = ceil(shown * video.rate - _EXACT) - video.count
        if lasts > 0:
            video.add(paint(), lasts)
    video.add(capture()(), round(LAST * video.rate))
