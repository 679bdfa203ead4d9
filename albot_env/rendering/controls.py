"""The controls: what keys do to a show, and the lines that say so."""

from __future__ import annotations

from math import inf

from albot_env.rendering.frame import clock_time
from albot_env.rendering.viewer import Footer

Jump = tuple[int, float]
"""So many steps and so many simulated seconds on, or back where they are negative."""

SLOWEST, FASTEST = 1 / 16, 1024.0
"""Between these times real time the speed is changed by keys."""
_FAR = 10.0
"""A seek goes so far (s)."""

_SEEKS: dict[str, Jump] = {
    "b": (-1, 0.0),
    "left": (0, -_FAR),
    "right": (0, _FAR),
    "home": (0, -inf),
    "end": (0, inf),
}


class Controls:
    """What the person watching has asked for, by keys.

    Args:
        speed: How many times faster than simulated time it is shown at first.
        recorded: Whether the episode is recorded: then one can seek in it.
        more: What other keys do, for the line of keys.
    """

    def __init__(self, speed: float, *, recorded: bool, more: str = "") -> None:
        self.speed = speed
        """How many times faster than simulated time it is shown."""
        self.paused = False
        """Whether it stands still."""
        self.closed = False
        """Whether there is to be no more of it."""
        self._jumps: list[Jump] = []
        self._seeks = _SEEKS if recorded else {}
        seeking = ["b back", "arrows 10 s", "home/end"] if recorded else []
        parts = ["space pause", "n step", *seeking, "+/- speed", "q close"]
        self._keys = " · ".join([*([more] if more else []), *parts])

    def press(self, key: str) -> None:
        """A key was pressed; one that does nothing is let go."""
        if key == "q":
            self.closed = True
        elif key == "space":
            self.paused = not self.paused
        elif key == "n":
            self.paused = True
            self._jumps.append((1, 0.0))
        elif key in ("+", "="):
            self.speed = min(2 * self.speed, max(FASTEST, self.speed))
        elif key == "-":
            self.speed = max(self.speed / 2, min(SLOWEST, self.speed))
        elif key in self._seeks:
            self.paused |= key == "b"
            self._jumps.append(self._seeks[key])

    def take_jump(self) -> Jump | None:
        """The next jump that was asked for; None where there is none."""
        return self._jumps.pop(0) if self._jumps else None

    def footer(
        self, *, step: int, steps: int, time: float, duration: float | None, over: bool
    ) -> Footer:
        """What stands below the frame.

        Args:
            step: Steps shown.
            steps: Steps of the whole episode, at most.
            time: Simulated time shown (s).
            duration: That of the whole episode (s); None where it is not known.
            over: Whether this is its last moment.
        """
        how = "the end" if over else "paused" if self.paused else "playing"
        whole = "" if duration is None else f" of {clock_time(duration)}"
        status = f"{how} · ×{self.speed:g} · step {step} of {steps} · {clock_time(time)}{whole}"
        return Footer(status=status, keys=self._keys, share=min(1.0, step / max(1, steps)))
