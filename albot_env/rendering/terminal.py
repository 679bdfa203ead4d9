"""Scenes drawn in the terminal with braille characters: eight dots a character cell."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from jaxtyping import Float64, Int64
from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.text import Text

from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import Panel, Scene, lay_out
from albot_env.rendering.shapes import Shape

STYLES = {
    "wall": "white",
    "thing": "magenta",
    "laser": "red",
    "path": "bright_blue",
    "surface": "yellow",
    "believed": "green",
    "corrected": "cyan",
    "link": "blue",
    "doorway": "magenta",
    "place": "bold yellow",
    "particle": "yellow",
    "grid": "white",
    "home": "bold magenta",
    "robot": "bold bright_cyan",
}
"""Colour of each style of shape, as rich names them."""

ARROWS = "→↗↑↖←↙↓↘"
HOME = "⌂"
MARK = "●"

OCCUPIED = 0.65
"""Cells of an occupancy grid are drawn from this probability on."""

DOT_BITS = np.array(((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)), np.uint8)
"""The bit of each dot in a braille character, by row and column (Unicode block 2800)."""


class BrailleCanvas:
    """A grid of dots, two wide and four high in every character cell.

    Args:
        columns: Width (characters).
        rows: Height (characters).
        bounds: Smallest x, smallest y, largest x, largest y shown (m).
    """

    def __init__(self, columns: int, rows: int, bounds: tuple[float, float, float, float]) -> None:
        self._bits = np.zeros((rows, columns), np.uint8)
        self._styles = np.full((rows, columns), "", dtype="<U20")
        self._signs: dict[tuple[int, int], tuple[str, str]] = {}
        x0, y0, x1, y1 = bounds
        self._dots = np.array((2 * columns, 4 * rows))
        self._scale = float(min(self._dots[0] / (x1 - x0), self._dots[1] / (y1 - y0)))
        self._middle = np.array(((x0 + x1) / 2, (y0 + y1) / 2))

    def _place(self, points: Float64[np.ndarray, "*n 2"]) -> Int64[np.ndarray, "*n 2"]:
        """Column and row of the dot at each point."""
        centred = (points - self._middle) * (self._scale, -self._scale)
        return np.asarray(np.floor(centred + self._dots / 2), np.int64)

    def dots(self, points: Float64[np.ndarray, "n 2"], style: str) -> None:
        """Set the dots nearest to points; those outside the bounds are left out."""
        placed = self._place(points)
        x, y = placed[((placed >= 0) & (placed < self._dots)).all(axis=1)].T
        np.bitwise_or.at(self._bits, (y // 4, x // 2), DOT_BITS[y % 4, x % 2])
        self._styles[y // 4, x // 2] = style

    def segments(self, segments: Float64[np.ndarray, "n 4"], style: str) -> None:
        """Draw line segments."""
        for x1, y1, x2, y2 in segments:
            count = int(np.hypot(x2 - x1, y2 - y1) * self._scale * 1.5) + 2
            self.dots(
                np.stack((np.linspace(x1, x2, count), np.linspace(y1, y2, count)), axis=-1), style
            )

    def sign(self, point: Float64[np.ndarray, "2"], character: str, style: str) -> None:
        """Put a character at a point."""
        x, y = self._place(point)
        rows, columns = self._bits.shape
        if 0 <= x // 2 < columns and 0 <= y // 4 < rows:
            self._signs[int(y // 4), int(x // 2)] = (character, style)

    def line(self, row: int) -> Text:
        """One row of characters, neighbours of one style joined."""
        cells = [self._cell(row, column) for column in range(self._bits.shape[1])]
        text = Text(no_wrap=True)
        for style, run in groupby(cells, key=lambda cell: cell[1]):
            text.append("".join(character for character, _ in run), style=style)
        return text

    def _cell(self, row: int, column: int) -> tuple[str, str]:
        """A cell's character and style."""
        if (row, column) in self._signs:
            return self._signs[row, column]
        bits = int(self._bits[row, column])
        return (chr(0x2800 + bits), str(self._styles[row, column])) if bits else (" ", "")


def _draw(canvas: BrailleCanvas, shape: Shape) -> None:
    style = STYLES[shape.style]
    if shape.kind == "segments":
        canvas.segments(shape.data, style)
    elif shape.kind == "line":
        canvas.segments(np.concatenate((shape.data[:-1], shape.data[1:]), axis=1), style)
    elif shape.kind == "dots":
        canvas.dots(shape.data, style)
    elif shape.kind == "marks":
        for point in shape.data:
            canvas.sign(point, MARK, style)
    elif shape.kind == "grid":
        canvas.dots(shape.placed_grid.centres(OCCUPIED), style)
    elif shape.kind == "home":
        canvas.sign(shape.data[:2], HOME, style)
    else:
        eighth = round(float(shape.data[2]) / (np.pi / 4)) % 8
        canvas.sign(shape.data[:2], ARROWS[eighth], style)


def _panel(panel: Panel, scene: Scene, columns: int, rows: int) -> list[Text]:
    canvas = BrailleCanvas(columns, rows, scene.bounds)
    for shape in panel.shapes:
        _draw(canvas, shape)
    return [canvas.line(row) for row in range(rows)]


def draw_text(frame: Frame, columns: int, lines: int) -> Text:
    """Draw a frame as text that fits the terminal.

    Args:
        frame: What to draw.
        columns: Width to fill (characters).
        lines: Height not to exceed (characters).
    """
    scene = lay_out(frame)
    width = max(10, (columns - 3) // 2)
    x0, y0, x1, y1 = scene.bounds
    fitting = int(np.ceil(2 * width * (y1 - y0) / (x1 - x0) / 4))
    rows = max(4, min(lines - 2, fitting))
    left, right = (_panel(panel, scene, width, rows) for panel in scene.panels)
    titles = [Text(f"{panel.title:<{width}}", style="dim") for panel in scene.panels]
    text = Text(no_wrap=True, overflow="crop")
    text.append_text(titles[0]).append("   ").append_text(titles[1])
    for one, other in zip(left, right, strict=True):
        text.append("\n").append_text(one).append(" │ ", style="dim").append_text(other)
    text.append("\n" + scene.caption[:columns], style="bold")
    return text


class TerminalView:
    """Shows frames in place in a terminal, with something below them.

    Args:
        console: The terminal.
        footer: What stands below, such as a progress bar.
    """

    _FOOTER_LINES = 3

    def __init__(self, console: Console, footer: RenderableType) -> None:
        self._console = console
        self._footer = footer
        self._live = Live(footer, console=console, auto_refresh=False)
        self._live.start()

    def show(self, frame: Frame) -> bool:
        """Show a frame, as large as the terminal is now."""
        width, height = self._console.size
        drawing = draw_text(frame, width, height - self._FOOTER_LINES)
        self._live.update(Group(drawing, self._footer), refresh=True)
        return True

    def close(self) -> None:
        """Stop drawing; the last frame stays."""
        self._live.stop()
