"""Small logs of every format, written from poses and ranges that the tests know."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from albot_core.geometry.poses import compose, relative

BEAMS = {"carmen": 180, "robotlaser": 361, "corrected": 180, "wean": 180, "duke": 181, "json": 180}
SCANS = 6


def _words(values: object, digits: int = 6) -> str:
    return " ".join(f"{value:.{digits}f}" for value in np.atleast_1d(values))


class Drive:
    """A robot's drive: raw odometry, corrected poses, stamps and ranges, drawn by a seed."""

    def __init__(self, beams: int, scans: int = SCANS, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        steps = rng.normal((0.3, 0.0, 0.1), (0.1, 0.05, 0.2), (scans, 3))
        slips = rng.normal(0, (0.02, 0.02, 0.05), (scans, 3))
        odometry, corrected = [np.array((1.0, -2.0, 0.5))], [np.array((1.0, -2.0, 0.5))]
        for step, slip in zip(steps[1:], slips[1:], strict=True):
            odometry.append(compose(odometry[-1], step))
            corrected.append(compose(corrected[-1], step + slip))
        self.odometry = np.round(odometry, 6)
        self.corrected = np.round(corrected, 6)
        self.stamps = np.round(100.0 + np.cumsum(rng.uniform(0.5, 1.5, scans)), 6)
        self.ranges = np.round(rng.uniform(0.5, 8.0, (scans, beams)), 3)

    def flaser(self, k: int, laser: np.ndarray, robot: np.ndarray) -> str:
        return (
            f"FLASER {len(self.ranges[k])} {_words(self.ranges[k], 3)} {_words(laser)} "
            f"{_words(robot)} {self.stamps[k]:.6f} robot {self.stamps[k] - 100:.6f}"
        )

    def odom(self, pose: np.ndarray, stamp: float) -> str:
        return f"ODOM {_words(pose, 9)} 0.1 0.2 0.3 {stamp:.6f} robot {stamp:.6f}"

    def carmen(self) -> str:
        """A raw CARMEN log, an ODOM line beside each scan."""
        lines = ["# CARMEN Logfile", "PARAM robot_length 0.5 nohost 0", "SYNC start 0 robot 0"]
        for k, pose in enumerate(self.odometry):
            lines += [self.odom(pose, self.stamps[k]), self.flaser(k, pose, pose), "NEFF 12"]
        return "\n".join(lines) + "\n"

    def robotlaser(self, remissions: int | None = 2) -> str:
        """A CARMEN log of ROBOTLASER1 lines, the laser 0.1 m ahead of and 0.2 m beside."""
        lines = []
        for k, pose in enumerate(self.odometry):
            laser = compose(pose, np.array((0.1, -0.2, 0.0)))
            more = "" if remissions is None else f"{remissions} " + "0.5 " * remissions
            lines.append(
                f"ROBOTLASER1 0 -1.570796 3.141593 0.008727 12.5 0.01 0 {len(self.ranges[k])} "
                f"{_words(self.ranges[k], 3)} {more}{_words(laser)} {_words(pose)} "
                f"0.1 0.2 0.3 0.4 1e6 {self.stamps[k]:.6f} robot {self.stamps[k]:.6f}"
            )
        return "\n".join(lines) + "\n"

    def corrected_log(self) -> str:
        """A corrected CARMEN log, as GMapping's gfs2log writes one."""
        lines = []
        for k, pose in enumerate(self.corrected):
            arrival = pose
            if k:
                motion = relative(self.odometry[k - 1], self.odometry[k])
                half = compose(self.corrected[k - 1], motion / 2)
                lines.append(self.odom(half, self.stamps[k] - 0.1))
                arrival = compose(self.corrected[k - 1], motion)
            lines += [
                self.odom(arrival, self.stamps[k]),
                self.flaser(k, pose, pose),
                self.odom(pose, 0.0),
                "NEFF 20",
            ]
        return "\n".join(lines) + "\n"

    def wean(self) -> str:
        """A Wean Hall log: centimetres, the laser 25 cm ahead."""
        lines = []
        for k, pose in enumerate(self.odometry):
            laser = compose(pose, np.array((0.25, 0.0, 0.0)))
            robot, ahead = pose * (100, 100, 1), laser * (100, 100, 1)
            ranges = " ".join(f"{100 * value:.1f}" for value in self.ranges[k])
            stamp = f"{self.stamps[k]:.6f}"
            lines.append(f"O {_words(robot)} {stamp}")
            lines.append(f"L {_words(robot)} {_words(ahead)} {ranges} {stamp}")
        return "\n".join(lines) + "\n"

    def duke(self) -> str:
        """A log of DP-SLAM."""
        lines = []
        for pose, ranges in zip(self.odometry, self.ranges, strict=True):
            lines += [f"Odometry {_words(pose)} ", f"Laser {len(ranges)} {_words(ranges)} "]
        return "\n".join(lines) + "\n"

    def json(self) -> str:
        """A log as JSON, one number a line."""
        scans = {
            f"{self.stamps[k]:.6f}": {
                "range": self.ranges[k].tolist(),
                "theta": pose[2],
                "x": pose[0],
                "y": pose[1],
            }
            for k, pose in enumerate(self.odometry)
        }
        return json.dumps({"map": scans}, indent=4)


WRITERS: dict[str, Callable[[Drive], str]] = {
    "carmen": Drive.carmen,
    "robotlaser": Drive.robotlaser,
    "corrected": Drive.corrected_log,
    "wean": Drive.wean,
    "duke": Drive.duke,
    "json": Drive.json,
}


def make_drive(kind: str, seed: int = 0, scans: int = SCANS) -> Drive:
    return Drive(BEAMS[kind], scans, seed)


@pytest.fixture(params=sorted(WRITERS))
def kind(request: pytest.FixtureRequest) -> str:
    """The name of each format in turn."""
    return str(request.param)


@pytest.fixture
def drive() -> Callable[..., Drive]:
    """Makes the drive whose log is written in the format of a name."""
    return make_drive


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a text to a file and returns its path."""

    def write_file(text: str, name: str = "run.log") -> Path:
        path = tmp_path / name
        path.write_text(text)
        return path

    return write_file


@pytest.fixture(scope="session")
def log_text() -> Callable[[str], str]:
    """The text of a small log in the format of a name."""
    return cache(lambda kind, **options: WRITERS[kind](make_drive(kind, **options)))
