"""The command itself: called alone, and with streams that are closed."""

from __future__ import annotations

import errno
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path

import click
import pytest
import yaml

import albot_env
from albot_agents.registry import EXPLORE, agent_names
from albot_cli import mappers, progress
from albot_cli.group import albot
from albot_cli.main import main
from albot_cli.number_types import CountType
from albot_cli.path_type import PathType
from albot_core.files import atomic_write
from tests import processes

ALBOT = f'"{sys.executable}" -c "from albot_cli.main import main; main()"'
SHORT = "--world square-loop --mapper odometry --steps 5"


@pytest.mark.parametrize("words", [(), ("worlds",), ("experiment",)])
def test_a_group_called_alone_shows_its_help(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["albot", *words])
    with pytest.raises(SystemExit) as ended:
        main()
    shown = capsys.readouterr()
    assert ended.value.code == 2
    assert shown.out == ""
    assert shown.err.startswith("Usage: ")
    assert "Commands:" in shown.err


@pytest.mark.parametrize(("word", "near"), [("dance", ""), ("paly", " (did you mean play?)")])
def test_an_unknown_subcommand_is_one_line(
    word: str, near: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["albot", word])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    assert capsys.readouterr().err == f"albot: No such command '{word}'.{near}\n"


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_stop_no_work(closed: str, tmp_path: Path) -> None:
    done = subprocess.run(
        f"{ALBOT} play {SHORT} {closed}",
        shell=True,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"episode.mcap", "episode.png"}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
@pytest.mark.parametrize("words", ["mappers", "mappers --json", "worlds list", "play --help"])
def test_a_full_disk_is_one_line_and_status_2(words: str) -> None:
    done = subprocess.run(
        f"{ALBOT} {words} > /dev/full", shell=True, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert done.stderr == "albot: cannot write what is printed: No space left on device\n"


def test_a_full_disk_is_said_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(**_: object) -> None:
        with atomic_write(tmp_path / "figures.json"):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(mappers.command, "callback", full)
    monkeypatch.setattr(sys, "argv", ["albot", "mappers"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    message = f"albot: cannot write {tmp_path / 'figures.json'}: No space left on device\n"
    assert capsys.readouterr().err == message


def test_the_module_is_the_command() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "albot_cli.main", "mappers"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "albot1" in done.stdout


def _commands(group: click.Group, context: click.Context) -> Iterator[click.Command]:
    """All commands below a group."""
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        if isinstance(command, click.Group):
            yield from _commands(command, context)
        else:
            yield command


def test_an_empty_path_is_refused_by_every_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    paths = [
        parameter
        for command in _commands(albot, click.Context(albot))
        for parameter in command.params
        if isinstance(parameter.type, click.Path)
    ]
    assert len(paths) > 20
    assert all(isinstance(path.type, PathType) for path in paths)
    monkeypatch.setattr(sys, "argv", ["albot", "map", "intel.log", "--out", ""])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    message = "albot: Invalid value for '--out': expected a path, found ''.\n"
    assert capsys.readouterr() == ("", message)


def test_all_progress_goes_by_one_rule() -> None:
    """Only one module draws any, and it draws none where a program reads."""
    scripts = Path(progress.__file__).parents[1]
    drawing = [path.name for path in scripts.rglob("*.py") if "rich.progress" in path.read_text()]
    assert drawing == ["progress.py"]
    flags = [
        parameter
        for command in _commands(albot, click.Context(albot))
        for parameter in command.params
        if "--json" in parameter.opts and parameter.name == "as_json"
    ]
    assert len(flags) > 15
    assert {flag.help for flag in flags if isinstance(flag, click.Option)} == {
        "Print one JSON object, and show no progress."
    }


def test_whole_numbers_are_read_as_people_write_them() -> None:
    ranges = [
        (command, parameter)
        for command in _commands(albot, click.Context(albot))
        for parameter in command.params
        if isinstance(parameter.type, click.types.IntParamType)
    ]
    assert len(ranges) > 15
    for command, parameter in ranges:
        assert isinstance(parameter.type, CountType), (command.name, parameter.name)
    for text, number in (("1e3", 1000), ("2.5E2", 250), ("1_000", 1000), ("7", 7)):
        assert CountType(1).convert(text, None, None) == number
    for text in ("1.5", "1e-1", "nan", "inf", "1e999999999", "", "x", "0"):
        with pytest.raises(click.BadParameter):
            CountType(1).convert(text, None, None)


@pytest.mark.parametrize("words", [("play",), ("stress",)])
def test_help_names_every_agent_that_fits(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["albot", *words, "--help"])
    with pytest.raises(SystemExit):
        main()
    shown = "".join(capsys.readouterr().out.split())  # lines break within names
    task = None if words == ("play",) else EXPLORE
    assert all(name in shown for name in agent_names(task))


def test_one_version_everywhere() -> None:
    root = Path(__file__).parents[2]
    project = tomllib.loads((root / "pyproject.toml").read_text())
    assert "version" not in project["project"]  # It is built with the package's.
    assert project["tool"]["hatch"]["version"]["path"] == "albot_env/__init__.py"
    cited = yaml.safe_load((root / "CITATION.cff").read_text())
    assert cited["version"] == albot_env.__version__ == version("albot-env")
    addresses = [each["url"] for each in cited["references"] if "url" in each]
    assert list(project["project"]["urls"].values()) == addresses


@pytest.mark.parametrize(
    ("words", "found"),
    [
        ("train homing --robot pionier", "--robot: expected one of pioneer-3dx, kobuki, peoplebot"),
        ("evaluate homing --robot 5", "--robot: expected one of pioneer-3dx, kobuki, peoplebot"),
        ("stress --shrink nan", "'--shrink': nan is not in the range x>=0."),
        ("stress --beams nan", "'--beams': nan is not in the range 0<x<=1."),
        ("play --speed nan", "'--speed': nan is not in the range x>0."),
        ("export a.mcap", "Missing option '--to'. Choose from: tum, kitti, "),
    ],
)
def test_a_wrong_option_is_one_line_that_names_it(words: str, found: str, tmp_path: Path) -> None:
    ran = subprocess.run(
        [*processes.ALBOT, *words.split()], cwd=tmp_path, capture_output=True, text=True
    )
    assert (ran.returncode, ran.stdout, len(ran.stderr.splitlines())) == (2, "", 1)
    assert found in ran.stderr
    assert not list(tmp_path.iterdir())
