"""The window: scenes shown on the screen with pygame, and the keys pressed in it."""

from __future__ import annotations

import logging
import os
from collections import deque
from collections.abc import Sequence

import pygame

from albot_core.errors import InputError
from albot_env.rendering.canvas import paint
from albot_env.rendering.display import display_found
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import lay_out
from albot_env.rendering.viewer import Footer

SIZE = (1200, 640)

_UNSEEN = frozenset({"dummy", "offscreen"})
"""SDL's video drivers that show nothing; SDL falls back to them if no other opens."""

_NAMES = {"return": "enter", "escape": "q", "[+]": "+", "[-]": "-"}
"""Key names that differ from pygame's."""

_LOGGER = logging.getLogger(__name__)


class Window:
    """A resizable window; closing it, Escape and Q end the show.

    Without a display it is drawn in memory, unseen, as in gymnasium's own environments: their
    checks open every render mode on any machine.

    Args:
        title: Title of the window.
        rate: Maximum frame rate (1/s); `show` waits to keep it.

    Raises:
        InputError: No window can be opened.
    """

    def __init__(self, title: str, rate: float = 30.0) -> None:
        if not display_found() and os.environ.get("SDL_VIDEODRIVER") is None:
            _LOGGER.warning("no display (DISPLAY or WAYLAND_DISPLAY): nobody sees the window")
        self._title = title
        self._open_screen()
        self._clock = pygame.time.Clock()
        self._rate = rate
        self._open = True
        self._pressed: deque[str] = deque(maxlen=64)
        self._held: set[str] = set()
        self._touched: set[str] = set()

    def _open_screen(self) -> None:
        try:
            pygame.display.init()
            pygame.display.set_mode(SIZE, pygame.RESIZABLE)
        except pygame.error as error:
            raise InputError("window", "a display that opens", str(error)) from None
        pygame.display.set_caption(self._title)

    @property
    def seen(self) -> bool:
        """Whether it is on a real screen: a display named by the environment may not exist."""
        return pygame.display.get_driver() not in _UNSEEN

    @property
    def lasting(self) -> bool:
        """Whether the user can close it."""
        return True

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        """Show a frame; return False once the window is closed."""
        if self._open and not pygame.display.get_init():
            self._open_screen()  # Other code has called `pygame.quit()`.
        self._listen()
        if self._open:
            paint(lay_out(frame), pygame.display.get_surface(), footer)
            pygame.display.flip()
            self._clock.tick(self._rate)
        return self._open

    def keys(self) -> Sequence[str]:
        """Return the names of the keys that were pressed since the last call."""
        self._listen()
        pressed = tuple(self._pressed)
        self._pressed.clear()
        return pressed

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are, or since the last call were, held down."""
        self._listen()
        held = frozenset(self._held | self._touched)
        self._touched.clear()
        return held

    def _listen(self) -> None:
        listens = self._open and pygame.display.get_init()
        for event in pygame.event.get() if listens else ():
            if event.type == pygame.QUIT:
                self._press("q")
            elif event.type == pygame.KEYDOWN:
                self._press(_name(event.key))
            elif event.type == pygame.KEYUP:
                self._held.discard(_name(event.key))
            elif event.type == pygame.WINDOWFOCUSLOST:
                self._held.clear()  # Their release is not reported.

    def _press(self, name: str) -> None:
        self._open &= name != "q"
        self._pressed.append(name)
        self._held.add(name)
        self._touched.add(name)

    def close(self) -> None:
        """Close the window."""
        self._open = False
        pygame.display.quit()


def _name(key: int) -> str:
    """Return the name of a key."""
    name = pygame.key.name(key)
    return _NAMES.get(name, name)
