"""The controls of a viewer: the effects of keys, and the status lines that describe them."""

from __future__ import annotations

from math import inf

from albot_env.rendering.frame import clock_time
from albot_env.rendering.viewer import Footer

Jump = tuple[int, float]
"""A seek by a number of steps and by simulated time (s); negative values go back."""

SLOWEST, FASTEST = 1 / 16, 1024.0
"""Range of speeds that keys can set, as multiples of real time."""
_FAR = 10.0
"""Length of a seek (s)."""

_SEEKS: dict[str, Jump] = {
    "b": (-1, 0.0),
    "left": (0, -_FAR),
    "right": (0, _FAR),
    "home": (0, -inf),
    "end": (0, inf),
}


_HELP = (
    ("space", "pause, go on"),
    ("n", "pause, and one step"),
    ("+, -", "twice, half as fast"),
    ("?, h", "show or hide the keys"),
    ("q", "close"),
)
_SEEKING_HELP = (
    ("b", "pause, and one step back"),
    ("left, right", "10 s back or on"),
    ("home, end", "to the beginning, to the end"),
)
"""Keys and what they do, always and in recorded episodes."""


class Controls:
    """The state that the user controls by keys.

    Args:
        speed: Initial speed, as a multiple of simulated time.
        recorded: Whether the episode is a recording, in which seeking is possible.
        more: Description of further keys, for the line of keys.
    """

    def __init__(self, speed: float, *, recorded: bool, more: str = "") -> None:
        self.speed = speed
        """Speed, as a multiple of simulated time."""
        self.paused = False
        """Whether playback is paused."""
        self.closed = False
        """Whether the user has closed the viewer."""
        self._jumps: list[Jump] = []
        self._seeks = _SEEKS if recorded else {}
        seeking = ["b back", "arrows 10 s"] if recorded else []
        own = [more, "space pause"] if more else ["space pause", "n step", *seeking]
        # A line of 80 characters has room for the most important ones; the help has all.
        self._keys = " · ".join((*own, "+/- speed", "? keys", "q close"))
        known = _HELP + (_SEEKING_HELP if recorded else ())
        lines = (f"{key:<12}{what}" for key, what in known)
        self._help = tuple(filter(None, (*more.split(" · "), *lines)))
        self._is_helping = False

    def press(self, key: str) -> None:
        """Handle a pressed key; unknown keys are ignored."""
        if key == "q":
            self.closed = True
        elif key == "space":
            self.paused = not self.paused
        elif key == "n":
            self.paused = True
            self._jumps.append((1, 0.0))
        elif key in ("?", "h"):
            self._is_helping = not self._is_helping
        elif key in ("+", "="):
            self.speed = min(2 * self.speed, max(FASTEST, self.speed))
        elif key == "-":
            self.speed = max(self.speed / 2, min(SLOWEST, self.speed))
        elif key in self._seeks:
            self.paused |= key == "b"
            self._jumps.append(self._seeks[key])

    def take_jump(self) -> Jump | None:
        """Return and clear the next requested seek; None if there is none."""
        return self._jumps.pop(0) if self._jumps else None

    def footer(
        self, *, step: int, steps: int, time: float, duration: float | None, over: bool
    ) -> Footer:
        """Return the footer below the frame.

        Args:
            step: Current step.
            steps: Maximum number of steps of the episode.
            time: Current simulated time (s).
            duration: Duration of the whole episode (s); None if unknown.
            over: Whether this is the last moment.
        """
        how = "the end" if over else "paused" if self.paused else "playing"
        whole = "" if duration is None else f" of {clock_time(duration)}"
        status = f"{how} · ×{self.speed:g} · step {step} of {steps} · {clock_time(time)}{whole}"
        return Footer(
            status=status,
            keys=self._keys,
            share=min(1.0, step / max(1, steps)),
            help=self._help if self._is_helping else (),
        )
