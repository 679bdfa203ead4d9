"""`albot evaluate --record`: the files of the episodes, and the page that lists them."""

from __future__ import annotations

import base64
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from PIL import Image

from albot_agents.engine import choice
from albot_agents.evaluation.plan import Trial
from albot_agents.evaluation.recordings import Recording, Recordings, last_frame
from albot_agents.evaluation.together import run_together
from albot_agents.evaluation.trial import Outcome, run_trial
from albot_cli import evaluate
from albot_cli.evaluation_page import index_page
from albot_cli.outputs import own_folders
from albot_core.errors import InputError
from albot_env.recording.episode import FirstEpisode, NullRecorder
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import EpisodeWriter
from tests.cli.test_evaluate import Albot, run
from tests.cli.test_play import _environment
from tests.env import quick
from tests.inline_engine import InlineEngine
from tests.processes import ALBOT, running, wait_until

assert run  # The fixture.
WORDS = ("evaluate", "homing", "--worlds", "square-loop", "--outward", "5..6", "--json")


class Page(HTMLParser):
    """What stands in a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    def all(self, tag: str, attribute: str) -> list[str]:
        return [str(attrs[attribute]) for name, attrs in self.tags if name == tag]


def test_failures_are_kept_listed_and_played_again(
    run: Albot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_process: None
) -> None:
    """The oracle succeeds unless the time is too short: in two of three episodes."""
    words = (*WORDS, "--agent", "oracle", "--seeds", "3..5", "--steps", "228")
    status, out, err = run(*words, "--record", str(tmp_path / "kept"), "--only", "failures")
    assert (status, err) == (0, "")
    found = json.loads(out)
    plain = json.loads(run(*words)[1])
    for figures in (found, plain):
        for key in ("seconds", "files", "recorded"):
            figures.pop(key)
    assert found == plain  # To the bit.
    assert found["success_rate"] == pytest.approx(2 / 3)
    names = {"square-loop-seed-5"}
    files = {path.name for path in (tmp_path / "kept").iterdir()}
    assert files == {"index.html", *(name + end for name in names for end in (".mcap", ".html"))}
    page = Page((tmp_path / "kept" / "index.html").read_text())
    assert page.all("article", "class") == ["failure"]
    links = page.all("a", "href")
    assert {link for link in links if link.endswith(".html")} == {f"{name}.html" for name in names}
    assert all((tmp_path / "kept" / link).exists() for link in links)
    for source in page.all("img", "src"):
        with Image.open(BytesIO(base64.b64decode(source.split(",")[1]))) as image:
            assert image.size == (400, 240)
    header = EpisodeReader(tmp_path / "kept" / "square-loop-seed-5.mcap").header
    assert (header.agent, header.seed, header.world) == ("oracle", 5, "square-loop")
    # The command makes the same episode.
    command = next(word for word in page.words if "albot play" in word)
    *files_of_it, line = command.splitlines()
    monkeypatch.chdir(tmp_path)
    for written in files_of_it:
        subprocess.run(written, shell=True, check=True)
    assert run(*shlex.split(line)[1:], "--headless")[0] == 0
    again, first = (
        last_frame(path) for path in (Path("episode.mcap"), Path("kept/square-loop-seed-5.mcap"))
    )
    np.testing.assert_array_equal(again.path, first.path)
    np.testing.assert_array_equal(again.believed_path, first.believed_path)


def test_failures_stand_first_and_all_are_there(
    run: Albot, tmp_path: Path, in_process: None
) -> None:
    words = (*WORDS, "--agent", "oracle", "--against", "random", "--seeds", "3", "--steps", "230")
    status, out, _ = run(*words, "--record", str(tmp_path))
    assert status == 0
    found = json.loads(out)
    assert found["recorded"] == 2
    assert found["files"]["index"] == str(tmp_path / "index.html")
    page = Page((tmp_path / "index.html").read_text())
    assert page.all("article", "class") == ["failure", "success"]
    headings = [word for word in page.words if "· seed 3" in word]
    assert headings == ["random · square-loop · seed 3", "oracle · square-loop · seed 3"]
    before = (tmp_path / "oracle-square-loop-seed-3.mcap").read_bytes()
    status, _, err = run(*words, "--record", str(tmp_path))
    assert (status, "or --force to overwrite it" in err) == (2, True)
    assert run(*words, "--record", str(tmp_path), "--force")[0] == 0
    assert (tmp_path / "oracle-square-loop-seed-3.mcap").read_bytes() == before
    status, out, _ = run(*words, "--record", str(tmp_path), "--force", "--only", "failures")
    assert json.loads(out)["recorded"] == 1
    assert {path.stem for path in tmp_path.glob("*.mcap")} == {"random-square-loop-seed-3"}


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (("--only", "failures"), "--only: expected --record FOLDER"),
        (("--record", "taken"), "--record': Directory 'taken' is a file"),
        (("--record", "new", "--only", "losses"), "'losses' is not one of"),
    ],
)
def test_bad_input_is_one_line(
    run: Albot,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    found: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("taken").touch()
    status, _, err = run(*WORDS, "--agent", "random", *words)
    assert (status, len(err.strip().splitlines())) == (2, 1)
    assert found in err
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_exploring_neither_fails_nor_succeeds(run: Albot, tmp_path: Path) -> None:
    words = ("evaluate", "explore", "--agent", "random", "--worlds", "square-loop")
    record = ("--record", str(tmp_path / "new"), "--only", "failures")
    status, _, err = run(*words, "--seeds", "1", *record)
    assert status == 2
    assert "--only: expected a task that can succeed or fail, found Albot/Explore-v0" in err
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="folders cannot be locked there")
@pytest.mark.parametrize("option", ["--record", "--out"])
def test_one_process_at_a_time_writes_into_a_folder(
    run: Albot, tmp_path: Path, option: str
) -> None:
    words = (*WORDS, "--agent", "random", "--seeds", "1", "--steps", "5", option, tmp_path / "new")
    with own_folders(tmp_path / "new"):
        status, _, err = run(*map(str, words))
    assert status == 2
    assert "new: expected a folder that no other process writes into, found one that does" in err
    assert not list((tmp_path / "new").iterdir())
    assert run(*map(str, words))[0] == 0


def test_recordings_stay_whatever_comes_after_the_episodes(
    run: Albot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise InputError("failures.png", "room on the disk")

    monkeypatch.setattr(evaluate, "_write", fail)
    words = (*WORDS, "--agent", "random", "--seeds", "1..2", "--steps", "5")
    assert run(*words, "--record", str(tmp_path / "new"))[0] == 2
    assert len(list((tmp_path / "new").glob("*.mcap"))) == 2


def test_who_is_refused_removes_nothing(tmp_path: Path) -> None:
    with own_folders(tmp_path / "a" / "new", tmp_path / "a" / "new", None):
        (tmp_path / "a" / "new" / "mine").touch()
        with pytest.raises(InputError, match="no other process"), own_folders(tmp_path / "a/new"):
            pass
    assert (tmp_path / "a" / "new" / "mine").exists()
    with pytest.raises(InputError, match="later"), own_folders(tmp_path / "b" / "new"):
        raise InputError("later", "something else")
    assert not (tmp_path / "b").exists()


def test_a_figure_of_no_failures_is_told(run: Albot, tmp_path: Path) -> None:
    figure = ("--figure", str(tmp_path / "a.png"), "--seeds", "1", "--steps", "5")
    words = ("evaluate", "explore", "--agent", "random", "--worlds", "square-loop")
    expected = "--figure: expected a task that can fail, whose failures it shows, found Albot/Expl"
    assert expected in run(*words, *figure)[2]
    words = (*WORDS, "--agent", "oracle", "--seeds", "1", "--figure", str(tmp_path / "a.png"))
    status, _, err = run(*words)
    assert (status, "a.png: not drawn, because no episode failed" in err) == (0, True)
    out = ("--out", str(tmp_path), "--figure", str(tmp_path / "failures.png"))
    assert "--figure: expected a file other than those" in run(*WORDS, "--agent", "random", *out)[2]
    assert not list(tmp_path.iterdir())


def test_an_error_on_the_way_leaves_no_folder(
    run: Albot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(trial: Trial) -> None:
        if trial.seed == 4:
            raise InputError("world", "another one")

    monkeypatch.setattr(choice, "make_engine", lambda *_, **__: InlineEngine(fail))
    words = (*WORDS, "--agent", "random", "--seeds", "3..4", "--steps", "5")
    assert run(*words, "--record", str(tmp_path / "new"))[0] == 2
    assert not list(tmp_path.iterdir())
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "mine").touch()
    assert run(*words, "--record", str(tmp_path / "old"))[0] == 2
    assert [path.name for path in (tmp_path / "old").iterdir()] == ["mine"]


def test_ctrl_c_leaves_whole_episodes_and_their_list(tmp_path: Path) -> None:
    words = (*WORDS, "--agent", "random", "--seeds", "1..2000", "--steps", "40", "--jobs", "2")
    command = [*ALBOT, *words, "--record", "kept"]
    with running(command, tmp_path, _environment()) as process:
        wait_until(lambda: any(tmp_path.glob("kept/*.mcap")))
        os.killpg(process.pid, signal.SIGINT)  # As the terminal does: the workers get it, too.
        out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    found = json.loads(out)
    files = sorted(path.name for path in (tmp_path / "kept").iterdir())
    assert len(files) == 2 * found["recorded"] + 1
    for path in (tmp_path / "kept").glob("*.mcap"):
        reader = EpisodeReader(path)
        assert list(reader.moments())
        assert not reader.torn


HOSTILE = '<script>alert("1")</script>&\'/../x:y\n'


def test_hostile_names_are_shown_as_they_are(tmp_path: Path) -> None:
    trials = [
        Trial(task="Albot/Homing-v0", agent="a", world=world, seed=1)
        for world in (HOSTILE, HOSTILE.upper(), "..", "a/b", "a:b", "A-B", "ä", "x" * 500)
    ]
    recordings = Recordings.plan(tmp_path, trials)
    names = list(recordings.names.values())
    assert len({name.lower() for name in names}) == len(names)
    for name in names:
        assert re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9._-]{0,99}", name), name
    outcomes = [
        Outcome(
            trial=trial,
            info={"is_success": success},
            start=np.zeros(3),
            begin=np.zeros(3),
            path=np.zeros((2, 2)),
            collisions=0,
            recording=Recording(
                episode=recordings.path(trial, ".mcap"),
                page=recordings.path(trial, ".html"),
                thumbnail=b"png",
                command=f"albot play --world {HOSTILE}",
                steps=1,
                seconds=0.1,
            ),
        )
        for trial, success in zip(trials[:2], (True, False), strict=True)
    ]
    page = Page(text := index_page(HOSTILE, [HOSTILE], outcomes))
    assert not [tag for tag, _ in page.tags if tag == "script"]
    assert "<script" not in text
    assert "".join(page.words).count(HOSTILE) == 6
    assert page.all("article", "class") == ["failure", "success"]


def test_episodes_that_run_together_are_recorded_as_alone(tmp_path: Path) -> None:
    settings = {"mapper": "odometry", "max_episode_steps": 6}
    trials = [
        Trial(task="Albot/Explore-v0", agent="random", world=world, seed=seed, settings=settings)
        for world, seed in (("square-loop", 3), ("office-ring", 4))
    ]
    files = [tmp_path / f"{k}.mcap" for k in range(2)]
    plain = run_together(trials)
    recorded = run_together(trials, recorders=[EpisodeWriter(file) for file in files])
    for k, (one, other) in enumerate(zip(plain, recorded, strict=True)):
        np.testing.assert_array_equal(one.path, other.path)
        alone = tmp_path / "alone.mcap"
        run_trial(trials[k], recorder=EpisodeWriter(alone))
        ours, theirs = EpisodeReader(files[k]), EpisodeReader(alone)
        assert (ours.header.seed, ours.header.agent) == (trials[k].seed, "random")
        pairs = list(zip(ours.moments(), theirs.moments(), strict=True))
        assert len(pairs) == 7
        for mine, its in pairs:
            np.testing.assert_array_equal(mine.pose, its.pose)
            assert (mine.reward, mine.facts) == (its.reward, its.facts)


def test_a_batch_draws_those_that_are_chosen() -> None:
    settings = {"world": quick.LOOP, "mapper": "none", "render_mode": "rgb_array"}
    envs: Any = gymnasium.make_vec("Albot/Explore-v0", num_envs=4, drawn=[2, 1], **settings)
    whole: Any = gymnasium.make_vec("Albot/Explore-v0", num_envs=4, **settings)
    for each in (envs, whole):
        each.reset(seed=1)
        each.step(np.full((4, 3), 0.5, np.float32))
    some, every = envs.render(), whole.render()
    assert len(some) == len(every) == 4
    for k in (1, 2):
        np.testing.assert_array_equal(some[k], every[k])
    assert some[0].shape == every[0].shape
    assert not some[0].any()
    assert some[0] is some[3]
    assert list(envs.frames) == [1, 2]
    assert list(whole.frames) == [0, 1, 2, 3]


@pytest.mark.parametrize("drawn", [[4], [-1], [1, 1], []])
def test_those_that_are_drawn_are_numbers_of_environments(drawn: Any) -> None:
    settings = {"world": quick.LOOP, "mapper": "none", "render_mode": "rgb_array"}
    with pytest.raises(InputError, match="drawn: expected different numbers of environments"):
        gymnasium.make_vec("Albot/Explore-v0", num_envs=4, drawn=drawn, **settings)
    with pytest.raises(InputError, match="drawn: expected a render_mode"):
        gymnasium.make_vec("Albot/Explore-v0", num_envs=4, drawn=[1], world=quick.LOOP)


def test_a_recorder_of_one_environment_is_that() -> None:
    envs: Any = gymnasium.make_vec("Albot/Explore-v0", num_envs=2, world=quick.LOOP, mapper="none")
    with pytest.raises(InputError, match="recorder: expected a Recorder, found 5"):
        envs.set_attr("recorder", [5, NullRecorder()])
    recorder = FirstEpisode(NullRecorder())
    envs.set_attr("recorder", [recorder, NullRecorder()])
    assert envs.get_attr("recorder")[0] is recorder
    envs.reset(seed=1)
    assert list(envs.frames) == [0]
