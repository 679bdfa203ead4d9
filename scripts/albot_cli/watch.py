"""Show an episode in a window or the terminal, at a chosen speed."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from itertools import count
from math import inf

import click
from rich.console import Console

from albot_cli.episodes import PlayedEpisode
from albot_cli.progress import can_redraw, progress
from albot_core.errors import InputError
from albot_env.rendering.controls import Controls
from albot_env.rendering.viewer import Footer, NullViewer, Viewer

EVERY = 5.0
"""Time between two lines of progress without a terminal (s)."""
FRAME_RATE = 20.0
"""Largest number of frames shown per second."""
LONGEST_STEP = 10.0
"""Longest simulated time for which a step is shown (s); in place recognition, where the robot moves
from stop to stop, a step can take minutes."""
_LAG = 0.25
"""Largest delay by slow drawing that is caught up (s)."""
_KEY_POLL_INTERVAL = 0.02
"""Time between two checks for keys (s)."""


def watch(
    episode: PlayedEpisode,
    viewer: Viewer,
    controls: Controls,
    *,
    update: Callable[[], None] = lambda: None,
    at_end: Callable[[], None] = lambda: None,
) -> None:
    """Show an episode at the chosen speed; without a viewer, run it as fast as possible.

    The last picture stays until the user closes it, if the viewer has keys. Ctrl-C then closes it,
    too: nothing is broken off.

    Args:
        episode: The episode.
        viewer: Shows the frames.
        controls: The state set by keys: pause, speed, jumps.
        update: Called after every step.
        at_end: Called once, when the episode is over or the user quits.
    """
    watched, ended, stale = not isinstance(viewer, NullViewer), False, True
    pace, shown = _Pace(controls), -inf
    try:
        while not controls.closed:
            if _handle_keys(viewer, controls):
                pace.resume()
                stale = True
            stale |= _advance(episode, controls, pace if watched else None, update)
            if episode.over and not ended:
                at_end()
                ended = True
            if watched and stale and (episode.over or time.monotonic() >= shown + 1 / FRAME_RATE):
                viewer.show(episode.frame, _footer(episode, controls))
                # From the end of drawing, so that a slow viewer leaves the episode time to run.
                shown, stale = time.monotonic(), False
            if ended and not viewer.lasting:
                break
            if watched:
                is_running = not (controls.paused or episode.over)
                wait = max(pace.wait, 0.0) if is_running else _KEY_POLL_INTERVAL
                time.sleep(min(wait, _KEY_POLL_INTERVAL))
    except KeyboardInterrupt:
        if not ended:
            raise
    if not ended:
        at_end()


def _advance(
    episode: PlayedEpisode,
    controls: Controls,
    pace: _Pace | None,
    update: Callable[[], None],
) -> bool:
    """Take the jump that was asked for, or the step that is due; return whether there was one.

    Without a pace, a step is always due.
    """
    jump = controls.take_jump()
    if jump is not None:
        episode.jump(*jump)
        return True
    if controls.paused or episode.over or (pace is not None and pace.wait > 0):
        return False
    before = episode.time
    episode.advance()
    update()
    if pace is not None:
        pace.follow(episode.time - before)
    return True


def _handle_keys(viewer: Viewer, controls: Controls) -> bool:
    """Handle the pressed keys; return whether there were any."""
    keys = viewer.keys()
    for key in keys:
        controls.press(key)
    return bool(keys)


class _Pace:
    """Times the steps of the episode."""

    def __init__(self, controls: Controls) -> None:
        self._controls = controls
        self._due, self._took = time.monotonic(), 0.0

    def resume(self) -> None:
        """Continue from now at the current speed, after a key was pressed."""
        now = time.monotonic()
        self._due = min(max(self._due, now), now + self._took / self._controls.speed)

    @property
    def wait(self) -> float:
        """Time until the next step is due (s)."""
        return self._due - time.monotonic()

    def follow(self, took: float) -> None:
        """Schedule the next step after one that took `took` of simulated time (s)."""
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
def open_viewer(title: str, steps: int, *, headless: bool) -> Iterator[tuple[Viewer, StepCallback]]:
    """Open a window if there is a display, otherwise use the terminal, otherwise nothing.

    Unless the terminal shows the episode, stderr shows the progress.

    Args:
        title: Title of the episode.
        steps: Largest number of steps of the episode.
        headless: Whether to show only the progress.

    Yields:
        The viewer, and a callable to call after each step.
    """
    window = None if headless else _open_window(title)
    if window is None and not headless and can_redraw(sys.stdout):
        from albot_env.rendering.terminal import TerminalView

        with closing(TerminalView(Console())) as view:
            yield view, _update_nothing
        return
    with (
        closing(window or NullViewer()) as viewer,
        progress(title, steps, "steps", every=EVERY) as tell,
    ):
        numbers = count(1)
        yield viewer, lambda: tell(next(numbers))


def keys_expected() -> bool:
    """Return whether a viewer with keys seems available, without opening one."""
    from albot_env.rendering.display import display_found

    return display_found() or (can_redraw(sys.stdin) and can_redraw(sys.stdout))


StepCallback = Callable[[], None]
"""Called after each step."""


def _update_nothing() -> None:
    """Do nothing: the terminal view shows the progress."""


def _open_window(title: str) -> Viewer | None:
    """Return a window; None if there is no display, or it does not open."""
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
