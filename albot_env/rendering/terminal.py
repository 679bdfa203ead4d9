"""Scenes drawn in the terminal with braille characters of eight dots each."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack, closing
from itertools import groupby, zip_longest

import numpy as np
from jaxtyping import Float64, Int64
from rich.console import Console
from rich.live import Live
from rich.text import Text

from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import Panel, lay_out
from albot_env.rendering.shapes import Shape
from albot_env.rendering.terminal_keyboard import TerminalKeyboard
from albot_env.rendering.viewer import Footer

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
    "activity": "red",
    "grid": "white",
    "home": "bold magenta",
    "robot": "bold bright_cyan",
}
"""Colour of each style of shape, as rich names them."""

ARROWS = "→↗↑↖←↙↓↘"
HOME = "⌂"
MARK = "●"
SIGNS = {"marks": MARK, "dots": "⠶", "home": HOME, "robot": ARROWS[0]}
"""Legend sign of each kind of shape; a line for the others."""
BETWEEN = " │ "
"""Separator between panels."""
THREE = 110
"""Minimum width (characters) for a third panel."""
LEAST = 60, 16
"""Least width and height of a terminal in which a picture can be made out (characters)."""
FEWEST_ROWS = 10
"""Minimum number of rows of a panel; other lines are omitted first."""

OCCUPIED = 0.65
"""Minimum probability at which a cell of an occupancy grid is drawn."""
STRONG = 0.1
"""Minimum strength at which other cells are drawn."""

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
        """Return column and row of the dot at each point."""
        centred = (points - self._middle) * (self._scale, -self._scale)
        return np.asarray(np.floor(centred + self._dots / 2), np.int64)

    def dots(self, points: Float64[np.ndarray, "n 2"], style: str) -> None:
        """Set the dots nearest to points; points outside the bounds are ignored."""
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
        """Return one row of characters; neighbours of the same style are joined."""
        cells = [self._cell(row, column) for column in range(self._bits.shape[1])]
        text = Text(no_wrap=True)
        for style, run in groupby(cells, key=lambda cell: cell[1]):
            text.append("".join(character for character, _ in run), style=style)
        return text

    def _cell(self, row: int, column: int) -> tuple[str, str]:
        """Return a cell's character and style."""
        if (row, column) in self._signs:
            return self._signs[row, column]
        bits = int(self._bits[row, column])
        return (chr(0x2800 + bits), str(self._styles[row, column])) if bits else (" ", "")


def _style(shape: Shape) -> str:
    return STYLES[shape.style] + (" dim" if shape.is_thin else "")


def _draw(canvas: BrailleCanvas, shape: Shape) -> None:
    style = _style(shape)
    if shape.kind == "segments":
        canvas.segments(shape.data, style)
    elif shape.kind == "line":
        canvas.segments(np.concatenate((shape.data[:-1], shape.data[1:]), axis=1), style)
    elif shape.kind == "dots":
        canvas.dots(shape.data, style)
    elif shape.kind == "marks":
        for k, point in enumerate(shape.data):
            # There is room for one digit only.
            name = shape.names[k].lstrip("P") if shape.names else ""
            canvas.sign(point, name if len(name) == 1 else MARK, style)
    elif shape.kind == "grid":
        canvas.dots(shape.placed_grid.centres(OCCUPIED), style)
    elif shape.kind == "cells":
        canvas.dots(shape.data[shape.data[:, 3] >= STRONG, :2], style)
    elif shape.kind == "home":
        canvas.sign(shape.data[:2], HOME, style)
    else:
        eighth = round(float(shape.data[2]) / (np.pi / 4)) % 8
        canvas.sign(shape.data[:2], ARROWS[eighth], style)


def _panel(panel: Panel, columns: int, rows: int) -> list[Text]:
    canvas = BrailleCanvas(columns, rows, panel.bounds)
    for shape in panel.shapes:
        _draw(canvas, shape)
    return [canvas.line(row) for row in range(rows)]


def _legend(panel: Panel, columns: int) -> list[Text]:
    """Return the meaning of each sign of a panel, in as many lines as needed."""
    lines = [Text(no_wrap=True)]
    for shape in panel.shapes:
        sign = SIGNS.get(shape.kind, "⣿" if shape.kind in ("grid", "cells") else "━")
        entry = Text(f"{sign} ", style=_style(shape)).append(shape.label, style="default")
        if lines[-1].cell_len and lines[-1].cell_len + 2 + entry.cell_len > columns:
            lines.append(Text(no_wrap=True))
        if lines[-1].cell_len:
            lines[-1].append("  ")
        lines[-1].append_text(entry)
    return lines


def draw_text(frame: Frame, columns: int, lines: int, footer: Footer | None = None) -> Text:
    """Draw a frame as text that fits the terminal.

    In a narrow terminal the third panel is omitted; in a low one the legend, then the rewards
    and the heading.

    Args:
        frame: What to draw.
        columns: Width to fill (characters).
        lines: Height not to exceed (characters).
        footer: Footer below the frame; None for none.
    """
    scene = lay_out(frame)
    panels = scene.panels if columns >= THREE else scene.panels[:2]
    shares = np.array([panel.share for panel in panels])
    room = columns - len(BETWEEN) * (len(panels) - 1)
    widths = np.maximum(10, room * shares / shares.sum()).astype(int).tolist()
    heading = [Text(scene.heading, style="bold")]
    titles = _beside([[Text(panel.title, style="dim")] for panel in panels], widths)
    legend = _beside([_legend(*each) for each in zip(panels, widths, strict=True)], widths)
    figures, *rewards = (Text(caption) for caption in scene.captions)
    below = []
    if footer is not None:
        done = round(footer.share * columns)
        bar = Text("━" * done, style="bright_blue").append("─" * (columns - done), style="dim")
        below = [bar, Text(footer.status, style="bright_blue"), Text(footer.keys, style="dim")]
    for optional in (legend, rewards, heading):
        rows = lines - sum(map(len, (heading, titles, legend, rewards, below))) - 1
        if rows < FEWEST_ROWS:
            optional.clear()
    rows = lines - sum(map(len, (heading, titles, legend, rewards, below))) - 1
    x0, y0, x1, y1 = scene.bounds
    fitting = int(np.ceil(2 * widths[0] * (y1 - y0) / (x1 - x0) / 4))
    rows = max(4, min(rows, fitting))
    drawn = _beside(
        [_panel(panel, width, rows) for panel, width in zip(panels, widths, strict=True)], widths
    )
    if footer is not None and footer.help:
        drawn = [Text(line) for line in footer.help[:rows]]
    text = Text(no_wrap=True, overflow="crop")
    for line in (*heading, *titles, *drawn, *legend, figures, *rewards, *below):
        line.truncate(columns)
        text.append_text(line).append("\n")
    text.right_crop(1)
    return text


def _too_small(columns: int, lines: int, footer: Footer | None) -> Text:
    """Return what a terminal shows that is too small for a picture."""
    said = [f"too small: {columns} × {lines} characters", f"needed: {LEAST[0]} × {LEAST[1]}"]
    if footer is not None:
        said += [footer.status, "q close"]
    text = Text(no_wrap=True, overflow="crop")
    for line in map(Text, said[: lines - 1]):
        line.truncate(columns)
        text.append_text(line).append("\n")
    text.right_crop(1)
    return text


def _beside(columns: Sequence[list[Text]], widths: Sequence[int]) -> list[Text]:
    """Join columns of lines side by side, all but the last padded to their widths (characters)."""
    beside = []
    for row in zip_longest(*columns, fillvalue=Text()):
        line = Text(no_wrap=True)
        for k, (text, width) in enumerate(zip(row, widths, strict=True)):
            part = text.copy()
            part.truncate(width, pad=k < len(widths) - 1)
            line.append(BETWEEN if k else "", style="dim").append_text(part)
        beside.append(line)
    return beside


class TerminalView:
    """Shows frames in place in a terminal, and reads the keys typed in it.

    While it is open, typed keys are not echoed and none is left for the shell. The terminal's
    settings are restored when it is closed, at the latest when Python ends.

    Args:
        console: The terminal.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._size = console.size
        with ExitStack() as undo:
            self._keyboard = undo.enter_context(closing(TerminalKeyboard()))
            self._live = undo.enter_context(Live(console=console, auto_refresh=False))
            self._undo = undo.pop_all()

    @property
    def lasting(self) -> bool:
        """Whether the user can close it by a key."""
        return self._keyboard.there

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        """Show a frame, fitted to the terminal's current size."""
        if self._console.size != self._size:
            self._size = self._console.size
            self._console.clear()  # The old frame was re-wrapped.
        width, height = self._size
        if width < LEAST[0] or height < LEAST[1]:
            text = _too_small(width, height, footer)
        else:
            # The last line stays empty, or the terminal would scroll.
            text = draw_text(frame, width, height - 1, footer)
        self._live.update(text, refresh=True)
        return True

    def keys(self) -> Sequence[str]:
        """Return the names of the keys typed since the last call."""
        return self._keyboard.keys()

    def held(self) -> frozenset[str]:
        """Return the names of the keys typed within `HOLD`."""
        return self._keyboard.held()

    def close(self) -> None:
        """Stop drawing; the last frame stays."""
        self._undo.close()
