"""Types of common arrays; the test run checks their shapes."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

Pose = Float64[np.ndarray, "3"]
"""x, y (m) and heading (rad, counter-clockwise from +x)."""

Poses = Float64[np.ndarray, "*poses 3"]
"""Any number of poses."""

BroadcastPoses = Float64[np.ndarray, "*#poses 3"]
"""Poses whose shape broadcasts against that of other arguments."""

Points = Float64[np.ndarray, "*points 2"]
"""Any number of points x, y (m)."""

Segments = Float64[np.ndarray, "segments 4"]
"""Line segments x1, y1, x2, y2 (m)."""

Ranges = Float64[np.ndarray, "beams"]
"""Distances along beams (m); infinity where there was no return."""
