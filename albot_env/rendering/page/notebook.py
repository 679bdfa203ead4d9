"""The page of an episode inside a notebook."""

from __future__ import annotations

import html
from pathlib import Path

from albot_env.rendering.page.episode_page import episode_page


class NotebookPage:
    """A page that a notebook displays, in a frame of its own.

    Args:
        episode: The file of the episode.
        height: Height of the frame (pixels).

    Raises:
        InputError: The episode cannot be read, or has no step.
    """

    def __init__(self, episode: Path, height: int) -> None:
        self._episode, self._height = episode, height
        self._page = episode_page(episode).decode()

    def __repr__(self) -> str:
        return f"the page of {self._episode}"

    def _repr_html_(self) -> str:
        # Without allow-same-origin the page can do nothing to the notebook.
        return (
            f'<iframe sandbox="allow-scripts" width="100%" height="{self._height}" '
            f'style="border:0" srcdoc="{html.escape(self._page)}"></iframe>'
        )
