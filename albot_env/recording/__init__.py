"""Episodes as MCAP files: written while they run, read back, and readable by Foxglove.

- `episode`: an episode as data, and the recorder interface,
- `writer`, `reader`: the file,
- `messages`, `layers`: moments and layers of maps as messages; `foxglove`: parts of messages,
- `schemas`: the JSON Schema of each message,
- `command`: the command that makes an episode again,
- `show`: an episode in a notebook.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from albot_env.rendering.page.notebook import NotebookPage

__all__ = ["show"]


def show(episode: str | Path, *, height: int = 900) -> NotebookPage:
    """Return the page of a recorded episode, which a notebook displays and plays.

    Args:
        episode: The file.
        height: Height of the page in the notebook (pixels).

    Raises:
        InputError: The episode cannot be read, or has no step.
    """
    # The page reads episodes, and so needs this package.
    from albot_env.rendering.page.notebook import NotebookPage

    return NotebookPage(Path(episode), height)
