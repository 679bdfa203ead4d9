"""The window: scenes on the screen, by pygame."""

from __future__ import annotations

import logging
import os

import pygame

from albot_core.errors import InputError
from albot_env.rendering.canvas import paint
from albot_env.rendering.display import display_found
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import lay_out

SIZE = (1200, 640)

_UNSEEN = frozenset({"dummy", "offscreen"})
"""SDL's video drivers that show nothing; it takes one of them where no other opens."""

_LOGGER = logging.getLogger(__name__)


class Window:
    """A window of its own, resizable; closing it, Escape or Q end the show.

    Without a display it is drawn in memory, unseen. So do gymnasium's own
    environments, whose checks open every render mode wherever they run.

    Args:
        title: What stands in the window's bar.
        rate: At most this many frames a second; the caller waits for the rest.

    Raises:
        InputError: No window opens.
    """

    def __init__(self, title: str, rate: float = 30.0) -> None:
        if not display_found() and os.environ.get("SDL_VIDEODRIVER") is None:
            _LOGGER.warning("no display (DISPLAY or WAYLAND_DISPLAY): nobody sees the window")
        try:
            pygame.display.init()
            self._screen = pygame.display.set_mode(SIZE, pygame.RESIZABLE)
        except pygame.error as error:
            raise InputError("window", "a display that opens", str(error)) from None
        pygame.display.set_caption(title)
        self._clock = pygame.time.Clock()
        self._rate = rate
        self._open = True

    @property
    def seen(self) -> bool:
        """Whether it is on a real screen: one that the environment variables name may be gone."""
        return pygame.display.get_driver() not in _UNSEEN

    def show(self, frame: Frame) -> bool:
        """Show a frame; false once the window was closed."""
        for event in pygame.event.get():
            pressed = event.key if event.type == pygame.KEYDOWN else None
            if event.type == pygame.QUIT or pressed in (pygame.K_ESCAPE, pygame.K_q):
                self._open = False
        if self._open:
            paint(lay_out(frame), pygame.display.get_surface() or self._screen)
            pygame.display.flip()
            self._clock.tick(self._rate)
        return self._open

    def close(self) -> None:
        """Close the window."""
        self._open = False
        pygame.display.quit()
