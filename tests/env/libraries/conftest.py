"""Small environments for the libraries of users; and a stand-in for a writer of videos."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
import pytest

EXPLORE: dict[str, Any] = {"world": "square-loop", "mapper": "none", "max_episode_steps": 6}
RECOGNISE: dict[str, Any] = {
    "world": "square-loop",
    "mapper": "none",
    "config": {"tour": {"arrivals": 4}},
    "journeys": 2,
}


class Clip:
    """Takes the place of moviepy's clip, and keeps what it was given."""

    made: ClassVar[list[Clip]] = []

    def __init__(self, frames: list[np.ndarray], fps: int) -> None:
        self.frames, self.fps = list(frames), fps
        self.made.append(self)

    def write_videofile(self, *_: Any, **__: Any) -> None:
        """Write nothing."""


@pytest.fixture
def clips(monkeypatch: pytest.MonkeyPatch) -> list[Clip]:
    """The videos that are made, in a process with our stand-in for moviepy."""
    Clip.made.clear()
    for name in ("moviepy", "moviepy.video", "moviepy.video.io"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    module: Any = ModuleType("moviepy.video.io.ImageSequenceClip")
    module.ImageSequenceClip = sys.modules["moviepy"].ImageSequenceClip = Clip  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return Clip.made
