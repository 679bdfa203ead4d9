"""The viewer: an interface for showing frames and reading the user's keys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from albot_env.rendering.frame import Frame


@dataclass(frozen=True, kw_only=True)
class Footer:
    """Text and progress bar below a frame."""

    status: str
    """Status of playback."""
    keys: str
    """Description of the keys."""
    share: float
    """Progress in the episode, from 0 to 1."""
    help: tuple[str, ...] = ()
    """Lines about the keys, shown over the picture; empty unless the user has asked for them."""


@runtime_checkable
class Viewer(Protocol):
    """Shows frames during an episode."""

    @property
    def lasting(self) -> bool:
        """Whether the user can close it, so that the last frame may stay until then."""

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        """Show a frame; return False if the user has closed the viewer."""

    def keys(self) -> Sequence[str]:
        """Return the names of the keys that were pressed since the last call, in order.

        A character is its own name; other names are `space`, `enter`, `left`, `right`, `up`,
        `down`, `home` and `end`. `q` also reports that the viewer was closed.
        """

    def held(self) -> frozenset[str]:
        """Return the names of the keys that are, or since the last call were, held down."""

    def close(self) -> None:
        """Release the screen."""


class NullViewer:
    """Shows nothing."""

    lasting = False

    def show(self, frame: Frame, footer: Footer | None = None) -> bool:
        """Show nothing."""
        return True

    def keys(self) -> Sequence[str]:
        """Return no keys."""
        return ()

    def held(self) -> frozenset[str]:
        """Return no keys."""
        return frozenset()

    def close(self) -> None:
        """Do nothing."""
