"""How long the command takes to start: compiling everything, and from the cache."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path


def measure_startup() -> dict[str, float]:
    """Time one step of `albot play` in processes of their own.

    Returns:
        `first_s` with an empty cache of compiled code, and `later_s` with a filled one.
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(Path(folder) / "cache")}
        first = _timed(Path(folder), environment)
        later = min(_timed(Path(folder), environment) for _ in range(3))
    return {"first_s": first, "later_s": later}


def _timed(folder: Path, environment: dict[str, str]) -> float:
    command = "from albot_cli.main import main; main()"
    files = ("--record", "a.mcap", "--png", "a.png", "--force")
    arguments = ("play", "--steps", "1", *files, "--json")
    started = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", command, *arguments],
        cwd=folder,
        env=environment,
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return time.perf_counter() - started
