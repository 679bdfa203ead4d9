"""The viewer: something that frames are shown in."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from albot_env.rendering.frame import Frame


@runtime_checkable
class Viewer(Protocol):
    """Shows frames as the episode goes."""

    def show(self, frame: Frame) -> bool:
        """Show a frame; false where the person watching has closed the viewer."""

    def close(self) -> None:
        """Release the screen."""


class NullViewer:
    """Shows nothing."""

    def show(self, frame: Frame) -> bool:
        """Show nothing."""
        return True

    def close(self) -> None:
        """Do nothing: nothing was opened."""
