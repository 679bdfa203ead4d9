"""What a machine's calibration measures is fixed work. No test of speed."""

from __future__ import annotations

from albot_benchmarks.timing import calibrate, describe_machine


def test_both_pieces_of_work_are_timed() -> None:
    figures = calibrate(rounds=1)
    assert figures.keys() == {"python_ms", "numpy_ms"}
    assert all(milliseconds > 0 for milliseconds in figures.values())


def test_the_machine_is_named() -> None:
    machine = describe_machine()
    assert machine["processor"]
    assert isinstance(machine["libraries"], dict)
