"""A picture of how surely places are recognised: precision over recall."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jaxtyping import Float64

from albot_core.files import replacing


def draw_curve(path: Path, title: str, curve: Float64[np.ndarray, "thresholds 2"]) -> None:
    """Draw a curve of recall and precision as a PNG file, whole or not at all."""
    # Imported here, since it takes long and most runs draw nothing.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.0, 5.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(
        xlim=(0.0, 1.0), ylim=(0.0, 1.03), xlabel="recall", ylabel="precision", title=title
    )
    axes.grid(color="#e4e7eb", linewidth=0.6)
    axes.plot(curve[:, 0], curve[:, 1], color="#5f3dc4", linewidth=1.6, marker=".")
    with replacing(path) as stream:
        figure.savefig(stream, format="png")
