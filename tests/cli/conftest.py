"""A corridor's log, and the command called on it."""

from __future__ import annotations

import errno
import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
from click.testing import CliRunner, Result

from albot_agents.engine import choice
from albot_cli import outputs, progress, train
from albot_cli.group import albot
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory
from albot_core.export.tum import write_tum
from albot_core.geometry.poses import compose
from albot_env.recording.writer import EpisodeWriter
from albot_env.tasks.explore.env import ExploreEnv
from tests.env.quick import LOOP
from tests.inline_engine import InlineEngine

FILES = {"trajectory.tum", "surfaces.geojson", "map.png", "map.albot"}
ERRORS = {"errors.csv", "errors.md", "errors.png"}
PLACES = {"network.graphml", "network.g2o", "events.txt"}
"""The files of a mapper that knows places besides."""
"""What `albot map --out` writes."""
WIDTH, LENGTH = 2.0, 14.0
"""A corridor from (0, -1) to (14, 1), with a niche in its left wall (m)."""


def corridor_ranges(x: float, y: float, heading: float) -> np.ndarray:
    """What 180 beams meet in the corridor; the slow way, wall by wall."""
    walls = [
        (0, -1, 14, -1),
        (14, -1, 14, 1),
        (14, 1, 8, 1),
        (8, 1, 8, 1.6),
        (8, 1.6, 6, 1.6),
        (6, 1.6, 6, 1),
        (6, 1, 0, 1),
        (0, 1, 0, -1),
    ]
    angles = heading + np.deg2rad(np.arange(-90, 90))
    directions = np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    nearest = np.full(180, 40.0)
    for x1, y1, x2, y2 in walls:
        run = np.array((x2 - x1, y2 - y1), np.float64)
        offset = np.array((x1 - x, y1 - y))
        across = directions[:, 0] * run[1] - directions[:, 1] * run[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (offset[0] * run[1] - offset[1] * run[0]) / across
            part = (offset[0] * directions[:, 1] - offset[1] * directions[:, 0]) / across
        hit = (reach > 0) & (part >= 0) & (part <= 1)
        nearest[hit] = np.minimum(nearest[hit], reach[hit])
    return nearest


@pytest.fixture(autouse=True)
def no_lines(monkeypatch: pytest.MonkeyPatch) -> None:
    """No lines of progress: on a busy machine a test may take so long that there is one."""
    monkeypatch.setattr(progress, "EVERY", math.inf)
    monkeypatch.setattr(train, "_EVERY", math.inf)


@pytest.fixture
def full_disk(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is moved to its final place meets a full disk."""

    @contextmanager
    def full(path: Path) -> Iterator[BinaryIO]:
        raise OSError(errno.ENOSPC, "No space left on device", str(path))
        yield BytesIO()

    monkeypatch.setattr(outputs, "atomic_write", full)


@pytest.fixture
def in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks run in this process."""
    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: InlineEngine())


@pytest.fixture
def corridor(tmp_path: Path) -> tuple[Path, Trajectory]:
    """A log of a drive along the corridor, its odometer 4 % short, and where it truly went."""
    truth, odometry, lines = np.array((1.0, 0, 0)), np.array((1.0, 0, 0)), []
    poses = []
    for k in range(28):
        step = np.array((0.4, 0, 0.02 * np.cos(k)))
        if k:
            truth, odometry = compose(truth, step), compose(odometry, step * (0.96, 1, 1.3))
        poses.append(truth)
        ranges = " ".join(f"{r:.3f}" for r in corridor_ranges(*truth))
        pose = " ".join(f"{value:.6f}" for value in odometry)
        lines.append(f"FLASER 180 {ranges} {pose} {pose} {k}.5 robot {k}.5")
    path = tmp_path / "corridor.log"
    path.write_text("\n".join(lines) + "\n")
    return path, Trajectory(stamps=np.arange(28) + 0.5, poses=np.stack(poses))


@pytest.fixture
def truth_file(corridor: tuple[Path, Trajectory]) -> Path:
    path = corridor[0].with_name("truth.tum")
    write_tum(corridor[1], path)
    return path


@pytest.fixture
def episode_file(tmp_path: Path) -> Path:
    """A recorded episode of forty steps with the odometry mapper."""
    env = ExploreEnv(LOOP, mapper="odometry")
    env.agent, env.recorder = "chance", EpisodeWriter(tmp_path / "watched.mcap")
    env.reset(seed=1)
    for k in range(40):
        env.step(np.array((0.5, 0.2 * np.sin(k), -1.0), np.float32))
    env.close()
    return tmp_path / "watched.mcap"


@pytest.fixture
def call() -> Callable[..., Result]:
    """Calls `albot` with arguments; errors of input come out as they are."""
    return lambda *arguments: CliRunner().invoke(
        albot, [str(argument) for argument in arguments], standalone_mode=False
    )


def figures(result: Result) -> dict[str, Any]:
    assert result.exception is None, result.exception
    parsed = json.loads(result.stdout)
    assert isinstance(parsed, dict)
    return parsed


def expect_error(result: Result, *words: str) -> None:
    assert isinstance(result.exception, InputError)
    for word in words:
        assert word in str(result.exception)
