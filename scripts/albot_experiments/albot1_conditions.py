"""The conditions that the experiments of the Albot1 thesis's chapter 4 share, beside ours."""

from __future__ import annotations

THESIS_MOTION = (
    "guided; a scan after each step, usually 1 m or 45° (section 3.1.2)",
    "guided by the true pose; steps of at most 1 m or 45°",
)
"""The robot's motion."""
THESIS_LASER = (
    "SICK LMS-200: 181 beams over 180°",
    "the same geometry, range noise 10 mm",
)
"""The laser."""
THESIS_ODOMETER = ("Pioneer 3DX, its error is not told", "`pioneer`")
"""The odometer."""
