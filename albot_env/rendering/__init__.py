"""One frame model, drawn in a window, in an image array, in the terminal and as a picture."""

import os

# pygame greets on standard output when first imported, where `--json` promises JSON alone.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
