"""A page that plays an episode: one HTML file, without a server or a network.

- `episode_page`: the page of a recorded episode;
- `tracks`, `events`, `tables`: what a page tells of it: what a mapper believed, what happened, and
  how that is kept small and is found at once;
- `document`: the HTML file, with the data inside;
- `player/`: what runs in the browser: plain JavaScript, of which nothing is built. `uPlot` draws
  the curves (https://github.com/leeoniya/uPlot, MIT licence).
"""

from __future__ import annotations

from albot_env.rendering.page.episode_page import episode_page, write_page

__all__ = ["episode_page", "write_page"]
