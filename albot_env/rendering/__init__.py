"""One frame model, drawn in a window, as an image array, in the terminal and as a PNG picture.

- `trace`, `frame`: an episode so far, and the data of its present moment,
- `layers`, `shapes`, `scene`: a frame as shapes, which all renderers draw,
- `window`, `canvas`, `terminal`, `picture`: the renderers; `viewer`: the interface of window and
  terminal; `terminal_keyboard`: keys typed in a terminal; `controls`: the effects of keys,
- `display`: whether there is a screen.
"""

import os

# pygame prints a greeting when first imported, but `--json` promises nothing but JSON.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
