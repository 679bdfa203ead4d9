"""Time of the first start, which compiles everything, and of later starts from the cache."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

EPISODE = """
import gymnasium
import albot_env

env = gymnasium.make("Albot/Explore-v0", world="office-ring", mapper="albot1")
env.reset(seed=1)
env.action_space.seed(1)
for _ in range(600):
    env.step(env.action_space.sample())
"""
"""The README's first example."""
PLAY = """
from albot_cli.main import main

main()
"""


def measure_startup() -> dict[str, float]:
    """Time one step of `albot play`, and the README's first episode, each in a new process.

    Returns:
        `first_s` and `later_s`: seconds of `albot play` with an empty and with a filled cache of
        compiled code. `episode_first_s` and `episode_later_s`: the same for the episode;
        `episode_first_cpu_s` and `episode_later_cpu_s`: its processor time (s).
    """
    words = ("play", "--steps", "1", "--record", "a.mcap", "--png", "a.png", "--force", "--json")
    (first, _), later = _measure(PLAY, words)
    (episode_first, first_cpu), episode_later = _measure(EPISODE, ())
    return {
        "first_s": first,
        "later_s": min(seconds for seconds, _ in later),
        "episode_first_s": episode_first,
        "episode_later_s": min(seconds for seconds, _ in episode_later),
        "episode_first_cpu_s": first_cpu,
        "episode_later_cpu_s": min(seconds for _, seconds in episode_later),
    }


def _measure(
    code: str, words: tuple[str, ...]
) -> tuple[tuple[float, float], list[tuple[float, float]]]:
    """Return wall-clock and processor time (s) of the first run of `code` and of three more."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder) / "cache")}
        runs = [_timed(code, words, Path(folder), environment) for _ in range(4)]
    return runs[0], runs[1:]


def _timed(
    code: str, words: tuple[str, ...], folder: Path, environment: dict[str, str]
) -> tuple[float, float]:
    started, before = time.perf_counter(), os.times()
    subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=folder,
        env=environment,
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    after = os.times()
    spent = after.children_user + after.children_system
    return time.perf_counter() - started, spent - before.children_user - before.children_system
