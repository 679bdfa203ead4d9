"""How an episode is watched: in a window or the terminal, at what speed, until when."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from math import inf

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from albot_cli.episodes import PlayedEpisode
from albot_core.errors import InputError
from albot_env.rendering.controls import Controls
from albot_env.rendering.viewer import Footer, NullViewer, Viewer

FRAME_RATE = 20.0
"""Frames shown in a second, at most."""
LONGEST_STEP = 10.0
"""A step is shown as if it took no more simulated time (s): a robot that is led from stop to stop
is on its way for minutes."""
_LAG = 0.25
"""What a slow picture costs is caught up with as far as this (s)."""
_ATTENTION = 0.02
"""So often keys are looked for (s)."""


def watch(
    episode: PlayedEpisode,
    viewer: Viewer,
    controls: Controls,
    *,
    tell: Callable[[], None] = lambda: None,
    at_end: Callable[[], None] = lambda: None,
) -> None:
    """Show an episode as fast as it is watched, or run it as fast as it goes where nobody does.

    The last picture stays until it is closed, where somebody can.

    Args:
        episode: The episode.
        viewer: Where it is shown.
        controls: What the keys have asked for.
        tell: Is called after every step.
        at_end: Is called once: when the episode is over, or is given up.
    """
    watched, ended, stale = not isinstance(viewer, NullViewer), False, True
    pace, shown = _Pace(controls), -inf
    while not controls.closed:
        if _heed(viewer, controls):
            pace.resume()
            stale = True
        jump, running = controls.take_jump(), not (controls.paused or episode.over)
        if jump is not None:
            episode.jump(*jump)
            stale = True
        elif running and (not watched or pace.wait <= 0):
            before = episode.time
            episode.advance()
            tell()
            pace.follow(episode.time - before)
            stale = True
        if episode.over and not ended:
            ended = True
            at_end()
        if watched and stale and (episode.over or time.monotonic() >= shown + 1 / FRAME_RATE):
            viewer.show(episode.frame, _footer(episode, controls))
            # From its end, so that a slow viewer never leaves the episode no time to run.
            shown, stale = time.monotonic(), False
        if ended and not viewer.lasting:
            break
        if watched:
            time.sleep(min(max(pace.wait, 0.0), _ATTENTION) if running else _ATTENTION)
    if not ended:
        at_end()


def _heed(viewer: Viewer, controls: Controls) -> bool:
    """Do what the keys ask for that were pressed; whether any was."""
    keys = viewer.keys()
    for key in keys:
        controls.press(key)
    return bool(keys)


class _Pace:
    """When the next step is due."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._due, self._took = time.monotonic(), 0.0

    def resume(self) -> None:
        """A key was pressed: go on from now, at the speed that is asked for now."""
        now = time.monotonic()
        self._due = min(max(self._due, now), now + self._took / self._controls.speed)

    @property
    def wait(self) -> float:
        """How long until it is due (s)."""
        return self._due - time.monotonic()

    def follow(self, took: float) -> None:
        """A step was taken that took so much simulated time (s)."""
        self._took = min(took, LONGEST_STEP)
        due = self._due + self._took / self._controls.speed
        self._due = max(due, time.monotonic() - _LAG)


def _footer(episode: PlayedEpisode, controls: Controls) -> Footer:
    return controls.footer(
        step=episode.step,
        steps=episode.steps,
        time=episode.time,
        duration=episode.duration,
        over=episode.over,
    )


@contextmanager
def open_viewer(title: str, steps: int, *, headless: bool) -> Iterator[tuple[Viewer, Tell]]:
    """Open a window where there is a display, else the terminal, else nothing.

    Where the terminal is free a line on stderr tells how far it is.

    Args:
        title: What is shown.
        steps: How many steps the episode has, at most.
        headless: Show nothing but the progress line, whatever there is.

    Yields:
        What shows frames, and what is to be called after each step.
    """
    window = None if headless else _open_window(title)
    if window is None and not headless and sys.stdout.isatty():
        from albot_env.rendering.terminal import TerminalView

        with closing(TerminalView(Console())) as view:
            yield view, _tell_nobody
        return
    progress = Progress(
        # Without markup, in which `:office:` of a world's name would be a picture.
        TextColumn("{task.description}", markup=False),
        BarColumn(bar_width=None),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        expand=True,
    )
    with closing(window or NullViewer()) as viewer, progress:
        task = progress.add_task(title, total=steps, rate="")
        began, done = time.monotonic(), 0

        def tell() -> None:
            nonlocal done
            done += 1
            rate = done / max(time.monotonic() - began, 1e-6)
            progress.update(task, advance=1, rate=f"{rate:.0f} steps/s")

        yield viewer, tell


Tell = Callable[[], None]
"""Is told that a step is done."""


def _tell_nobody() -> None:
    """Where the terminal shows it anyway."""


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
