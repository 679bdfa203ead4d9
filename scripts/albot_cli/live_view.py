"""The live view of an episode, in a window or the terminal, and the progress line below it."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from albot_core.errors import InputError
from albot_env.rendering.frame import Frame
from albot_env.rendering.viewer import NullViewer, Viewer


class LiveView:
    """Shows an episode as fast as it is watched, and as fast as it runs where nobody does.

    Args:
        viewer: Where frames are shown.
        progress: The progress line.
        title: What stands in it.
        total: Steps of the episode, if known.
        speed: How many times faster than the simulated time it is shown.
        frame_rate: Frames shown in a second, at most.
    """

    def __init__(
        self,
        viewer: Viewer,
        progress: Progress,
        title: str,
        total: int | None,
        speed: float,
        frame_rate: float = 20.0,
    ) -> None:
        self._viewer = viewer
        self._watched = not isinstance(viewer, NullViewer)
        self._progress = progress
        self._task = progress.add_task(title, total=total, rate="")
        self._speed = speed
        self._between = 1 / frame_rate
        self._began = self._shown = time.monotonic()
        self._steps = 0

    def step(self, simulated: float, frame: Callable[[], Frame]) -> bool:
        """One step is done; false where the person watching has had enough.

        Args:
            simulated: Simulated time since the start (s).
            frame: Gives the present frame; called only when it is to be shown.
        """
        self._steps += 1
        elapsed = max(time.monotonic() - self._began, 1e-6)
        self._progress.update(self._task, advance=1, rate=f"{self._steps / elapsed:.0f} steps/s")
        if not self._watched:
            return True
        time.sleep(max(0.0, simulated / self._speed - elapsed))
        if time.monotonic() - self._shown < self._between:
            return True
        watched = self._viewer.show(frame())
        # From its end, so that a slow viewer never leaves the episode no time to run.
        self._shown = time.monotonic()
        return watched

    def end(self, frame: Frame) -> None:
        """Show the last frame."""
        self._viewer.show(frame)


@contextmanager
def open_live_view(
    title: str, *, total: int | None, speed: float, headless: bool
) -> Iterator[LiveView]:
    """Open a live view: a window where there is a display, else the terminal, else nothing.

    Args:
        title: What is shown.
        total: Steps of the episode, if known.
        speed: How many times faster than the simulated time it is shown.
        headless: Show nothing but the progress line, whatever there is.
    """
    terminal = not headless and sys.stdout.isatty()
    console = Console(stderr=not terminal)
    progress = Progress(
        # Without markup, in which `:office:` of a world's name would be a picture.
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        console=console,
        expand=True,
    )
    window = None if headless else _open_window(title)
    if window is None and terminal:
        viewer = _terminal_view(console, progress)
    else:
        viewer = window or NullViewer()
        progress.start()
    try:
        yield LiveView(viewer, progress, title, total, speed)
    finally:
        viewer.close()
        progress.stop()


def _terminal_view(console: Console, progress: Progress) -> Viewer:
    from albot_env.rendering.terminal import TerminalView

    return TerminalView(console, progress)


def _open_window(title: str) -> Viewer | None:
    """A window; None where there is no display, or none that opens."""
    from albot_env.rendering.display import display_found

    if not display_found():
        return None
    from albot_env.rendering.window import Window

    try:
        window = Window(title, rate=60.0)
    except InputError as error:
        click.echo(f"albot: {error}; showing it here instead", err=True)
        return None
    if not window.seen:
        window.close()
        click.echo("albot: no window opens on the display; showing it here instead", err=True)
        return None
    return window
