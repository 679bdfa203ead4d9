"""`albot map` in a process of its own: its streams, its exit status, and Ctrl-C."""

from __future__ import annotations

import json
import os
import pty
import signal
import subprocess
import sys

import pytest

from tests.processes import known_paths, running

ALBOT = (sys.executable, "-c", "from albot_cli.main import main; main()")


def test_one_line_and_status_2_for_bad_input(corridor, tmp_path):
    path = tmp_path / "torn.log"
    path.write_text(corridor[0].read_text()[:5000])
    out = tmp_path / "out"
    done = subprocess.run(
        [*ALBOT, "map", path, "--out", out, "--json"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith(f"albot: {path}, line ")
    assert not out.exists()


def test_json_alone_on_stdout_and_nothing_on_a_quiet_stderr(corridor):
    done = subprocess.run(
        [*ALBOT, "map", corridor[0], "--json"], capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout)["scans"] == 28
    assert all("compiling" in line for line in done.stderr.splitlines())


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_a_progress_bar_on_a_terminal_unless_a_program_reads(corridor, flags):
    main, terminal = pty.openpty()
    with subprocess.Popen(
        [*ALBOT, "map", corridor[0], *flags], stdout=subprocess.PIPE, stderr=terminal
    ) as process:
        os.close(terminal)
        shown = _read_all(main)
        assert process.stdout is not None
        assert b"28" in process.stdout.read()
    assert process.returncode == 0
    assert (b"albot1 on corridor.log" in shown) == (not flags)


def _read_all(terminal: int) -> bytes:
    shown = b""
    try:
        while piece := os.read(terminal, 4096):
            shown += piece
    except OSError:
        pass
    os.close(terminal)
    return shown


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopping_leaves_nothing_half_written(corridor, tmp_path, number):
    # The signal comes when three of the four files are written.
    code = (
        "import os, signal, albot_cli.map as files\n"
        "from albot_cli.main import main\n"
        f"files.save_figure = lambda *_, **__: os.kill(os.getpid(), {number})\n"
        "main()"
    )
    command = [sys.executable, "-c", code, "map", corridor[0], "--out", tmp_path / "out"]
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    around = known_paths() | {"TMPDIR": str(scratch)}
    with running(command, tmp_path, around) as process:
        _, errors = process.communicate(timeout=120)
    assert process.returncode == 128 + number
    assert errors.strip() == b"albot: stopped"
    assert set(tmp_path.iterdir()) == {corridor[0], scratch}
    assert not list(scratch.iterdir())
