"""One frame model, drawn in a window, in an image array, in the terminal and as a picture.

- `trace`, `frame`: an episode so far, and what can be drawn of its present moment,
- `layers`, `shapes`, `scene`: a frame as shapes, which every renderer draws alike,
- `window`, `canvas`, `terminal`, `picture`: the renderers; `viewer`: what shows frames and hears
  keys, those of a terminal by `terminal_keyboard`; `controls`: what keys do,
- `display`: whether there is a screen.
"""

import os

# pygame greets on standard output when first imported, where `--json` promises JSON alone.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
