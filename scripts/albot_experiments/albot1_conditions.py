"""The conditions of the Albot1 thesis's experiments (section 3.1.2), and ours."""

from __future__ import annotations

THESIS_MOTION = (
    "guided; a scan after each step, usually 1 m or 45°",
    "guided by the true pose; steps of at most 1 m or 45°",
)
THESIS_LASER = (
    "SICK LMS 200: 181 beams over 180°, used up to 30 m",
    "the same beams, noise of 1 cm, one beam of 1,000 lost",
)
THESIS_ODOMETER = ("wheel encoders of a Pioneer 3 DX; errors not told", "`pioneer`")


def thesis_conditions(
    floor: str,
    movement: tuple[str, str],
    trials: tuple[str, str],
    odometer: str = THESIS_ODOMETER[1],
) -> dict[str, tuple[str, str]]:
    """Return the conditions of an experiment of chapter 3, and ours.

    Args:
        floor: Our floor.
        movement: The thesis's way to move and to take views, and ours.
        trials: The number of its journeys, and of ours.
        odometer: Our odometer.
    """
    return {
        "environment": ("level one of an office tower, furnished, carpeted; its plan", floor),
        "robot": ("Pioneer 3 DX", "its body and drive, simulated"),
        "laser": THESIS_LASER,
        "odometer": (THESIS_ODOMETER[0], odometer),
        "movement": movement,
        "trials": trials,
    }
