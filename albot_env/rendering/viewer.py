"""The viewer: something that frames are shown in, and that hears the keys of who watches."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from albot_env.rendering.frame import Frame


@dataclass(frozen=True, kw_only=True)
class Footer:
    """What stands below a frame for who watches."""

    status: str
    """How the show goes."""
    keys: str
    """What the keys do."""
    share: float
    """How much of the episode is over, from 0 to 1."""


@runtime_checkable
class Viewer(Protocol):
    """Shows frames as the episode goes."""

    @property
    def lasting(self) -> bool:
        """Whether somebody can close it, so that the last picture may stay until then."""

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        """Show a frame; false where the person watching has closed the viewer."""

    def keys(self) -> Sequence[str]:
        """The names of the keys that were pressed since the last call, in their order.

        A character is its own name; others are `space`, `enter`, `left`, `right`, `up`, `down`,
        `home` and `end`. `q` also stands for a viewer that was closed.
        """

    def held(self) -> frozenset[str]:
        """The names of the keys that are held down, or were since the last call."""

    def close(self) -> None:
        """Release the screen."""


class NullViewer:
    """Shows nothing."""

    lasting = False

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        """Show nothing."""
        return True

    def keys(self) -> Sequence[str]:
        """No keys: nobody watches."""
        return ()

    def held(self) -> frozenset[str]:
        """No keys."""
        return frozenset()

    def close(self) -> None:
        """Do nothing: nothing was opened."""
