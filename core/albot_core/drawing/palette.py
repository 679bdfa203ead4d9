"""The colours of all pictures: one thing has one colour everywhere.

The colours of `LIGHT` that lie over each other differ by at least 20 in CIELAB (ΔE*ab), also for
people who see no red, no green or no blue (Machado et al. 2009), and as much from the paper.
Tints of floors and of free ground are fainter: everything may be drawn over them.
"""

from __future__ import annotations

PAPER, TEXT, FAINT, RULE = "#ffffff", "#59626d", "#c9ccd1", "#e4e7eb"
"""Background; text on it; true walls under a map; lines of a grid behind everything."""
WALL, TRUTH, BELIEVED, CORRECTED = "#22262b", "#224c98", "#c76212", "#3dd7ff"
"""Walls and surfaces; where the robot truly was; where it believes it was; the same, corrected."""
PLACE, EXIT, PARTICLE, HOME = "#7b1ae2", "#a776a2", "#fcb006", "#0d9861"
FREE, SOLID = "#e9edf2", "#dcdcd8"
"""Free ground of an occupancy grid; what walls close off."""
TINTS = ("#e6f0fb", "#fdf1df", "#e5f5e9", "#f4e9f7", "#fdeae6", "#f2f1dc")
"""Floors of rooms, one after another."""
SERIES = (TRUTH, BELIEVED, HOME, PARTICLE, PLACE, EXIT, CORRECTED, WALL)
"""Colours of lines or kinds that have none of their own, one after another."""

LIGHT = {
    "wall": WALL,
    "thing": PLACE,
    "laser": BELIEVED,
    "path": TRUTH,
    "surface": WALL,
    "believed": BELIEVED,
    "corrected": CORRECTED,
    "link": "#a374e8",
    "doorway": EXIT,
    "place": PLACE,
    "particle": PARTICLE,
    "activity": PARTICLE,
    "grid": TEXT,
    "home": HOME,
    "robot": "#000000",
}
"""Colours of the shapes of a scene (see `albot_env.rendering.shapes`), on paper."""

_PALE = "#ecf0f5"
DARK = {
    "wall": _PALE,
    "thing": "#aea3ff",
    "laser": "#ebac5b",
    "path": "#767eff",
    "surface": _PALE,
    "believed": "#ebac5b",
    "corrected": "#69c1d7",
    "link": "#8a7ce0",
    "doorway": "#d56299",
    "place": "#aea3ff",
    "particle": "#ffdd41",
    "activity": "#ffdd41",
    "grid": "#808896",
    "home": "#3d915c",
    "robot": "#ffffff",
}
"""The same on the dark ground of the window, which has the colours below."""
DARK_GROUND, DARK_FREE = "#1e2128", "#2c303a"


def rgb(colour: str) -> tuple[int, int, int]:
    """Return the red, green and blue of `#rrggbb`, from 0 to 255."""
    red, green, blue = bytes.fromhex(colour[1:])
    return red, green, blue
