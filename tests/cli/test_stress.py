"""`albot stress` as people call it, its worker processes included."""

from __future__ import annotations

import errno
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from albot_cli import stress
from albot_cli.main import main
from albot_env.recording.reader import EpisodeReader
from albot_env.stress.checks import Finding
from albot_env.tasks.explore.env import ExploreEnv
from albot_stress import episodes
from albot_stress.episodes import Episode
from albot_stress.running import violated
from tests.processes import ALBOT, running, wait_until

KEYS = {
    "worlds", "agents", "episodes", "steps", "seconds", "steps_per_second", "violations",
}  # fmt: skip

BROKEN = """
import os, signal, sys

def each_otherwise(seeds, result):
    if 1 in seeds:
        os.kill(os.getpid(), signal.SIGKILL)
    if 2 in seeds:
        os._exit(3)
    if 0 in seeds:
        raise RuntimeError("lost")
    result[4]["time"][seeds.index(3)] = float("nan")

def step(self, actions):
    result = whole(self, actions)
    if round(10 * result[4]["time"].max()) == 4:
        {what}
    return result

def reset(self, *, seed=None, options=None):
    self.seeds = list(seed)
    return begin(self, seed=seed, options=options)

if "resource_tracker" not in sys.orig_argv[-1]:  # It runs nothing of ours, and need not load it.
    from albot_agents.engine import local
    from albot_env.tasks.explore.env import ExploreVectorEnv

    whole, begin = ExploreVectorEnv.step, ExploreVectorEnv.reset
    ExploreVectorEnv.step, ExploreVectorEnv.reset = step, reset
    local.RERUNS = 1  # Each takes a new process some seconds.
"""
"""What Python runs by itself before the command, in the worker processes too."""


def environment(folder: Path, what: str = "") -> dict[str, str]:
    (folder / "sitecustomize.py").write_text(BROKEN.format(what=what) if what else "")
    paths = [str(folder), *(path for path in sys.path if path)]
    ours = {"PYTHONPATH": os.pathsep.join(paths), "PYTHONDONTWRITEBYTECODE": "1", "COLUMNS": "100"}
    return {**os.environ, **ours}


def albot(folder: Path, *words: str, what: str = "") -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*ALBOT, *words],
        cwd=folder,
        env=environment(folder, what),
        capture_output=True,
        text=True,
        check=False,
    )


def test_sound_worlds_pass(tmp_path: Path):
    done = albot(tmp_path, "stress", "--worlds", "random:maze", "--count", "2", "--steps", "10",
                 "--seed", "4", "--jobs", "2", "--json")  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    found = json.loads(done.stdout)
    assert found.keys() >= KEYS
    assert found["worlds"] == 2
    assert found["agents"] == ["gap-explorer", "random"]
    assert (found["episodes"], found["steps"], found["violations"]) == (4, 40, [])
    assert found["steps_per_second"] == pytest.approx(40 / found["seconds"])
    assert list(tmp_path.iterdir()) == [tmp_path / "sitecustomize.py"]


SHORT = ("stress", "--worlds", "square-loop", "--count", "3", "--steps", "6", "--agent", "random",
         "--jobs", "1", "--shrink", "0")  # fmt: skip


def test_what_is_broken_is_found_in_every_episode(tmp_path: Path):
    """An error, two deaths of a worker, each with one more to take its place, and a bad step.

    The four episodes run together at first, and then each alone.
    """
    what = "each_otherwise(self.seeds, result)"
    done = albot(tmp_path, *SHORT, "--count", "4", "--json", what=what)
    assert (done.returncode, done.stderr) == (1, "")
    found = json.loads(done.stdout)
    assert found["episodes"] == 4
    assert [each["seed"] for each in found["violations"]] == [0, 1, 2, 3]
    said = (
        "RuntimeError: lost",
        "the process died: signal SIGKILL",
        "the process died: exit status 3",
        "info time holds nan",
    )
    for each, words in zip(found["violations"], said, strict=True):
        assert each.keys() >= {"world", "agent", "seed", "step", "what", "command"}
        assert each["step"] == 4
        assert each["what"].startswith(words)


def test_the_command_that_is_printed_shows_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    what = "raise RuntimeError('lost')"
    done = albot(tmp_path, *SHORT, what=what)
    assert done.returncode == 1
    lines = done.stdout.splitlines()
    assert len(lines) == 7
    assert lines[0].startswith("step 4: RuntimeError: lost")
    assert "3 violations" in lines[-1]

    def lost(self: ExploreEnv, action: Any) -> Any:
        raise RuntimeError("lost")

    monkeypatch.setattr(ExploreEnv, "step", lost)
    monkeypatch.setattr(sys, "argv", [*shlex.split(lines[1]), "--headless"])
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RuntimeError, match="lost"):
        main()


CAMPAIGN = """\
worlds: [square-loop]
count: 2
steps: 6
agents: [random]
odometers: [pioneer, poor]
"""


def test_a_campaign_is_shrunk_and_stored(tmp_path: Path):
    """What is wrong in every world at the fourth step needs no bad odometer, and no later seed."""
    (tmp_path / "night.yml").write_text(CAMPAIGN)
    what = "result[1][:] += 1.0"
    done = albot(tmp_path, "stress", "night.yml", "--jobs", "1", "--json", what=what)
    assert (done.returncode, done.stderr) == (1, "")
    found = json.loads(done.stdout)
    assert (found["episodes"], len(found["violations"])) == (4, 4)
    [shrunk] = found["shrunk"]
    assert shrunk["invariant"] == "reward"
    assert (shrunk["step"], shrunk["seed"]) == (4, 0)
    assert shrunk["command"] == (
        "albot play --world square-loop --agent random --mapper none --odometer ideal --seed 0 "
        "--steps 4 --no-movables"
    )
    assert shrunk["episode"] == "violations/violation-1.mcap"
    assert len(list(EpisodeReader(tmp_path / shrunk["episode"]).moments())) == 5
    kept = json.loads((tmp_path / "violations/violations.json").read_text())
    assert kept["shrunk"] == found["shrunk"]


def test_a_resumed_run_stores_its_violations_where_the_first_one_began_to(tmp_path: Path):
    """Its folder may be there already: the run may have been killed while it shrank."""
    what, out = "result[1][:] += 1.0", tmp_path / "deep" / "found"
    words = (*SHORT, "--shrink", "30", "--rows", "rows", "--out", "deep/found", "--json")
    done = albot(tmp_path, *words, what=what)
    assert (done.returncode, done.stderr) == (1, "")
    (out / "violation-1.mcap").unlink()
    again = albot(tmp_path, "stress", "--resume", "rows", "--json", "--jobs", "1", what=what)
    assert (again.returncode, again.stderr) == (1, "")
    first, second = json.loads(done.stdout), json.loads(again.stdout)
    assert first["violations"] == second["violations"]
    assert second["shrunk"][0]["episode"] == "deep/found/violation-1.mcap"
    assert (out / "violation-1.mcap").is_file()


def test_what_cannot_be_stored_is_told_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    episode = Episode(world="square-loop", agent="random", mapper="none", seed=3, steps=9)

    def run(campaign: Any, engine: Any, tally: Any, *rest: Any) -> None:
        tally.add(violated(episode, 4, [Finding("reward", "is too large")]))

    def shrink(*arguments: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "found")

    monkeypatch.setattr(stress, "_run", run)
    monkeypatch.setattr(stress, "_shrink", shrink)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["albot", *SHORT, "--shrink", "1", "--json"])
    with pytest.raises(SystemExit) as ended:
        main()
    shown = capsys.readouterr()
    assert ended.value.code == 2
    assert json.loads(shown.out)["violations"][0]["what"] == "is too large"
    assert "No space left on device" in shown.err


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--steps", "3"), "--steps: expected no such option with a campaign, found night.yml"),
        (("--agent", "random"), "--agent: expected no such option with a campaign"),
        (("--out", "."), "--out: expected a folder that is not there yet"),
    ],
)
def test_options_that_a_campaign_stands_for(
    words: tuple[str, ...],
    found: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    (tmp_path / "night.yml").write_text(CAMPAIGN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["albot", "stress", "night.yml", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert found in capsys.readouterr().err


def test_ctrl_c_before_the_first_episode_tells_how_it_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """Planning a hundred thousand episodes takes seconds."""

    def stop(*arguments: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(episodes, "plan_jobs", stop)
    rows = tmp_path / "rows"
    monkeypatch.setattr(sys, "argv", ["albot", *SHORT, "--rows", str(rows)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 130
    assert f"continue with: albot stress --resume {rows}" in capsys.readouterr().out


def test_ctrl_c_tells_what_was_found_so_far(tmp_path: Path):
    command = [*ALBOT, *SHORT, "--count", "100000", "--json"]
    going = environment(tmp_path, "open('going', 'w').close()")
    with running(command, tmp_path, going) as process:
        wait_until((tmp_path / "going").exists)
        os.killpg(process.pid, signal.SIGINT)  # As the terminal does: the workers get it too.
        out, errors = process.communicate(timeout=60)
    found: dict[str, Any] = json.loads(out)
    assert (process.returncode, errors) == (130, b"")
    assert found["stopped"] is True
    assert found["violations"] == []
    assert found["episodes"] < 100000


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--worlds", "random:ofice"), "did you mean office"),
        (("--worlds", "gone.yaml"), "gone.yaml"),
        (("--agent", "randm"), "did you mean random"),
        (("--mapper", "albot2"), "albot2"),
        (("--mapper", "ratslam-scenes"), "found ratslam-scenes, which needs scene"),
        (("--mapper-config", "a.yaml"), "a robot without a mapper"),
        (("--count", "0"), "count"),
        (("--steps", "0"), "steps"),
        (("--jobs", "0"), "jobs"),
        (("--seed", "-1"), "seed"),
        (("--worlds", "square-loop", "--seed", str(2**64)), "--seed"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    words: tuple[str, ...],
    found: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
):
    monkeypatch.setattr(sys, "argv", ["albot", "stress", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    shown = capsys.readouterr()
    assert (ended.value.code, shown.out) == (2, "")
    assert shown.err.startswith("albot: ")
    assert len(shown.err.splitlines()) == 1
    assert found in shown.err
