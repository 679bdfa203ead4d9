"""Ctrl-C, `kill` and closed pipes, at any time: no traceback, nothing half, nobody left behind."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from albot_env.recording.reader import EpisodeReader
from tests.processes import ALBOT, is_gone, known_paths, running, wait_until

AT_IMPORT = """
import os, signal, sys

left = {count}

def stop(event, words):
    global left
    left -= event == "import"
    if event == "import" and not left:
        os.kill(os.getpid(), {number})

sys.addaudithook(stop)
from albot_cli.main import main
main()
"""
"""The command, which gets a signal when it imports its so manyth module."""
PLAY = ("play", "--headless", "--world", "square-loop", "--mapper", "odometry")
STRESS = ("stress", "--worlds", "square-loop", "--agent", "random", "--jobs", "2", "--json")


@pytest.mark.parametrize(
    ("words", "count", "number"),
    [
        ("mappers", 12, signal.SIGINT),
        ("mappers", 60, signal.SIGTERM),
        ("mappers", 250, signal.SIGINT),
        ("experiment list", 90, signal.SIGINT),
        ("agents list", 800, signal.SIGINT),
        ("worlds list", 600, signal.SIGHUP),
        ("play --help", 500, signal.SIGINT),
        ("train", 400, signal.SIGINT),
    ],
)
def test_a_signal_while_modules_are_imported_is_no_traceback(
    words: str, count: int, number: int, tmp_path: Path
) -> None:
    code = AT_IMPORT.format(count=count, number=int(number))
    with running([sys.executable, "-c", code, *words.split()], tmp_path) as process:
        out, errors = process.communicate(timeout=60)
    assert out == b""
    assert errors.strip() in (b"", b"albot: stopped")
    assert process.returncode in (-number, 128 + number)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_leaves_a_whole_episode(number: int, tmp_path: Path) -> None:
    episode = tmp_path / "episode.mcap"
    with running([*ALBOT, *PLAY, "--steps", "1000000"], tmp_path) as process:
        wait_until(lambda: episode.exists() and episode.stat().st_size > 100_000)
        process.send_signal(number)
        out, errors = process.communicate(timeout=60)
    assert (process.returncode, out) == (128 + number, b"")
    assert b"albot: episode.mcap holds the episode up to here\n" in errors
    assert errors.endswith(b"albot: stopped\n")
    reader = EpisodeReader(episode)
    assert len(list(reader.moments())) > 20
    assert not reader.torn
    assert [path.name for path in tmp_path.iterdir()] == ["episode.mcap"]


def test_workers_end_with_whoever_started_them(tmp_path: Path) -> None:
    """Killed, it can end nobody. (Python itself tells of a worker whose start it did not end.)"""
    with running([*ALBOT, *STRESS, "--steps", "1000000"], tmp_path) as process:
        assert process.stderr is not None
        wait_until(lambda: _workers(process.pid) == 2)
        process.kill()
        process.wait()
        wait_until(lambda: is_gone(process.pid), 30)
        assert process.stderr.read() == b""


def _workers(starter: int) -> int:
    """How many of a process's children are workers that wait for its end, in a thread."""
    listed = subprocess.run(
        ["ps", "--ppid", str(starter), "-o", "nlwp="], capture_output=True, text=True, check=False
    )
    return sum(int(threads) > 1 for threads in listed.stdout.split())


def _session(number: int) -> list[int]:
    """The processes of a session."""
    listed = subprocess.run(["ps", "-A", "-o", "sess="], capture_output=True, text=True, check=True)
    return [int(word) for word in listed.stdout.split() if int(word) == number]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_to_all_processes_tells_what_was_found(number: int, tmp_path: Path) -> None:
    with running([*ALBOT, *STRESS, "--steps", "5", "--count", "100000"], tmp_path) as process:
        # Each has loaded what it needs once it takes time.
        wait_until(lambda: len(_session(process.pid)) > 2)
        os.killpg(process.pid, number)
        out, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (128 + number, b"")
    found = json.loads(out)
    assert (found["stopped"], found["violations"]) == (True, [])


@pytest.mark.parametrize(
    "words", ["mappers", "worlds list", "agents list --json", "play --help", "experiment list"]
)
def test_a_closed_pipe_is_no_fault(words: str, tmp_path: Path) -> None:
    end, ours = os.pipe()
    os.close(end)
    try:
        with running([*ALBOT, *words.split()], tmp_path, stdout=ours) as process:
            _, errors = process.communicate(timeout=60)
    finally:
        os.close(ours)
    assert (process.returncode, errors) == (128 + signal.SIGPIPE, b"")


def test_ignored_signals_stay_ignored(tmp_path: Path) -> None:
    code = (
        "import signal; signal.signal(signal.SIGHUP, signal.SIG_IGN);"
        "from albot_cli.main import main; import albot_cli.group;"
        "albot_cli.group.albot.callback = lambda: signal.raise_signal(signal.SIGHUP); main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "mappers"],
        cwd=tmp_path,
        env=known_paths(),
        capture_output=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"albot1" in done.stdout


DROPPED = """
import os, signal, time
from albot_cli.signals import Interrupts

class Callback:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)

Interrupts().listen()
each = Callback()
del each
try:
    time.sleep(60)
except KeyboardInterrupt:
    print("stopped")
"""
"""A signal that comes where Python drops all exceptions, as in a callback of LLVM."""


def test_a_signal_that_is_dropped_comes_again(tmp_path: Path) -> None:
    with running([sys.executable, "-c", DROPPED], tmp_path) as process:
        out, errors = process.communicate(timeout=30)
    assert (out, errors) == (b"stopped\n", b"")
