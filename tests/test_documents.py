"""What README and docs show: code that runs, commands that there are, and the keys of `info`."""

from __future__ import annotations

import gzip
import re
import runpy
import shlex
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import click
import gymnasium
import numpy as np
import pytest

from albot_cli.group import albot
from albot_maps import load_world
from tests.conftest import ROOT
from tests.core.scenes import FURNITURE, house_walk, scan_from, two_rooms
from tests.env import quick

PAGES = (
    "README.md",
    *sorted(
        path.relative_to(ROOT).as_posix()
        for folder in (".", "start", "guides", "tutorials")
        for path in (ROOT / "docs" / folder).glob("*.md")
    ),
)
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
SPAN = re.compile(r"`(albot [^`\n]*)`")
LANGUAGES = {"", "bash", "dockerfile", "mermaid", "python", "text", "yaml"}
"""Languages of code on the pages; `python` is run, and `bash` is read."""
ELSEWHERE = {
    "docs/exchange.md": "needs a data set, see test_the_data_set_of_a_page_is_learnt_from",
    "docs/saved_maps.md": "needs maps, see test_the_maps_of_a_page_are_used_as_it_says",
    "docs/mappers.md": "is tests/core/mappers/topological.py, see test_guide.py",
    "docs/tasks.md": "is tests/env/tasks/visit_rooms.py, see test_guide.py",
    "docs/guides/observation_part.md": "is followed by test_guides.py, as all in docs/guides",
    "docs/guides/world_kind.md": "as above",
    "docs/guides/agent.md": "as above",
    "docs/guides/log_format.md": "as above",
    "docs/guides/sensor.md": "as above",
}
"""Pages whose code other tests run."""
FASTER = {
    "num_envs=256": "num_envs=2",
    '"Albot/Explore-v0", 256': '"Albot/Explore-v0", 2',
    "batch_size=4096": "batch_size=64",
    "learn(1_000_000)": "learn(128)",
    "random:office:0..99": "random:office:0..1",
}
"""What is done less often here than on the pages."""
LEARNT_FASTER = {
    "range(40)": "range(2)",
    "range(10)": "range(1)",
    'world="random:office:2000..2009"': 'world="square-loop", max_episode_steps=3',
}
"""What is done less often here of what docs/exchange.md learns."""


def _blocks(page: str, *languages: str) -> list[str]:
    text = (ROOT / page).read_text(encoding="utf-8")
    return [code for language, code in BLOCK.findall(text) if language in languages]


def _write_log(path: Path) -> None:
    """A CARMEN log of a walk through two rooms."""
    walls = np.concatenate((two_rooms(), FURNITURE))
    lines = []
    for k, pose in enumerate(house_walk()):
        ranges = np.minimum(scan_from(pose, walls).ranges, 81.0)
        there = " ".join(f"{number:.6f}" for number in pose)
        words = " ".join(f"{distance:.3f}" for distance in ranges)
        lines.append(f"FLASER {len(ranges)} {words} {there} {there} {k} robot {k}\n")
    path.write_bytes(gzip.compress("".join(lines).encode()))


@pytest.mark.parametrize(
    "page", [page for page in PAGES if _blocks(page, "python") and page not in ELSEWHERE]
)
def test_the_code_of_a_page_runs_as_it_stands(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One block after the other, in a folder with a log to map."""
    code = "\n".join(_blocks(page, "python"))
    for shown, here in FASTER.items():
        code = code.replace(shown, here)
    (tmp_path / "page.py").write_text(code)
    _write_log(tmp_path / "intel.log.gz")
    monkeypatch.chdir(tmp_path)
    runpy.run_path("page.py")


def test_the_data_set_of_a_page_is_learnt_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The page's command makes one of two short journeys, and its code learns from that."""
    pytest.importorskip("minari", reason="minari is not installed: pip install '.[minari]'")
    pytest.importorskip("torch", reason="torch is not installed: pip install '.[train]'")
    page = "docs/exchange.md"
    (line,) = (line for line in _blocks(page, "bash")[-1].splitlines() if "--minari" in line)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    # The last of each option counts.
    shorter = ["--seeds", "0..1", "--worlds", "square-loop", "--outward", "1..2", "--steps", "20"]
    words = [*shlex.split(line)[1:], *shorter, "--jobs", "1"]
    albot.main(words, standalone_mode=False)
    code = "\n".join(_blocks(page, "python"))
    for shown, here in LEARNT_FASTER.items():
        assert shown in code
        code = code.replace(shown, here)
    (tmp_path / "page.py").write_text(code)
    runpy.run_path(str(tmp_path / "page.py"))
    assert re.search(r"loss \d\.\d+; home in \d+ of 10 offices\n$", capsys.readouterr().out)


def test_the_maps_of_a_page_are_used_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its commands make a map of a world, of a short drive, and its code localises in it."""
    page = "docs/saved_maps.md"
    monkeypatch.chdir(tmp_path)
    _write_log(tmp_path / "first.log.gz")
    lines = "\n".join(_blocks(page, "bash")).splitlines()
    short = {"play": ["--steps", "60", "--headless"]}
    for line in [lines[0], *(line for line in lines if "office" in line)]:
        words = shlex.split(line)[1:]
        albot.main([*words, *short.get(words[0], [])], standalone_mode=False)
    code = "\n".join(_blocks(page, "python"))
    (tmp_path / "page.py").write_text(code)
    found = runpy.run_path("page.py")
    assert found["mapper"].standing == "undecided"
    _, info = found["env"].reset(options={"start": (4.0, 3.0, 1.5)})
    assert not info["localised"]
    assert tuple(info["start"]) != (4.0, 3.0, 1.5)  # Home is where the map was begun.


def test_code_says_its_language_as_these_tests_know_it() -> None:
    texts = [(ROOT / page).read_text(encoding="utf-8") for page in PAGES]
    assert {language for text in texts for language, _ in BLOCK.findall(text)} <= LANGUAGES


def test_what_is_done_less_often_stands_on_some_page() -> None:
    shown = "".join(code for page in PAGES for code in _blocks(page, "python"))
    assert all(budget in shown for budget in FASTER)


def _commands() -> Iterator[tuple[str, str]]:
    """Each page's commands, those with `[` or `…` left out: they say what may be called."""
    for page in PAGES:
        lines = "\n".join(_blocks(page, "", "bash")).replace("\\\n", " ").splitlines()
        spans = SPAN.findall((ROOT / page).read_text(encoding="utf-8"))
        for line in dict.fromkeys((*lines, *spans)):
            found = re.search(r"(?:^|[\s/])(albot [^|;>]*)", line.replace("\\|", "|"))
            if found is not None and not re.search(r"[\[…]|  +[a-z]", found[1].partition("#")[0]):
                yield page, found[1]


@pytest.mark.parametrize(("page", "line"), list(_commands()))
def test_a_command_on_a_page_can_be_called(
    page: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its words are what the command takes; it is not run. A name alone is that of a command."""
    monkeypatch.setattr(click.Command, "invoke", lambda *_: None)
    # An eager option acts while it is read: in a user's empty folder, whatever shell runs this.
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("SHELL", "/bin/bash")
    for variable in ("XDG_DATA_HOME", "XDG_CONFIG_HOME"):
        monkeypatch.delenv(variable, raising=False)
    (tmp_path / "plans").mkdir()
    words = shlex.split(line.replace("$ALBOT_DATA", str(tmp_path)), comments=True)[1:]
    for option, world in pairwise(words):
        if option == "--world" and re.fullmatch("[a-z-]+", world):
            load_world(world)
    try:
        albot.main(words, standalone_mode=False)
    except (click.MissingParameter, click.exceptions.NoArgsIsHelpError):
        assert f"`{line}`" in (ROOT / page).read_text(encoding="utf-8")
        assert not any(word.startswith("-") for word in words)


TABLE = re.compile(r"^\| `info` of ([^|]*?) \| \|\n\|[-|]+\n((?:\|.*\n)+)", re.MULTILINE)
CLAIMS = {"re_entries", "right_claims", "false_claims"}


def _documented_infos() -> dict[str, set[str]]:
    """The keys of each task's info, as docs/environments.md tells them."""
    text = (ROOT / "docs" / "environments.md").read_text(encoding="utf-8")
    found: dict[str, set[str]] = {}
    for title, rows in TABLE.findall(text):
        cells = (row.split("|")[1] for row in rows.splitlines())
        keys = {key for cell in cells for key in re.findall(r"`(\w+)`", cell)}
        name, _, others = title.partition(":")
        for other in found:
            if f" {other}'s" in others:
                keys |= found[other] - (CLAIMS if "but of claims" in others else set())
        found[name] = keys
    return found


@pytest.mark.parametrize(
    ("environment", "title"),
    [
        ("Albot/Explore-v0", "exploring"),
        ("Albot/Homing-v0", "homing"),
        ("Albot/HomingByMap-v0", "homing by the map"),
        ("Albot/ExploreAndHome-v1", "exploring and coming home"),
        ("Albot/PlaceRecognition-v0", "recognising places"),
        ("Albot/Probe-Detour-v0", "the probes"),
    ],
)
def test_the_keys_of_infos_are_those_in_the_tables(environment: str, title: str) -> None:
    settings = {"world": quick.LOOP, "mapper": "none"} | quick.SETTINGS.get(environment, {})
    if "Probe" in environment:
        del settings["world"]
    env = gymnasium.make(environment, **settings)
    _, info = env.reset(seed=1)
    assert info.keys() == _documented_infos()[title]
    *_, after = env.step(quick.still(environment))
    assert after.keys() == info.keys()
