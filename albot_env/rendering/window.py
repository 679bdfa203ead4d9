"""The window: scenes on the screen, by pygame."""

from __future__ import annotations

import os

import pygame

from albot_core.errors import InputError
from albot_env.rendering.canvas import paint
from albot_env.rendering.display import display_found
from albot_env.rendering.frame import Frame
from albot_env.rendering.scene import lay_out

SIZE = (1200, 640)


class Window:
    """A window of its own, resizable; closing it, Escape or Q end the show.

    Args:
        title: What stands in the window's bar.
        rate: At most this many frames a second; the caller waits for the rest.

    Raises:
        InputError: There is no display.
    """

    def __init__(self, title: str, rate: float = 30.0) -> None:
        if not display_found() and os.environ.get("SDL_VIDEODRIVER") is None:
            raise InputError(
                "window",
                'a display (DISPLAY or WAYLAND_DISPLAY); without one use render_mode="rgb_array"',
                "none",
            )
        try:
            pygame.display.init()
            self._screen = pygame.display.set_mode(SIZE, pygame.RESIZABLE)
        except pygame.error as error:
            raise InputError("window", "a display that opens", str(error)) from None
        pygame.display.set_caption(title)
        self._clock = pygame.time.Clock()
        self._rate = rate
        self._open = True

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
