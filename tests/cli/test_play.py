"""`albot play` as people call it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from albot_agents.task import find_task
from albot_agents.trained.trained_agent import shipped_agents
from albot_cli.episodes import RecordedEpisode
from albot_cli.main import main
from albot_env.recording.reader import EpisodeReader
from albot_env.rendering.scene import lay_out
from albot_env.sim import LASERS, ODOMETERS, ROBOTS, SCENES, SONARS
from tests.cli.terminal import Terminal

KEYS = {
    "world", "agent", "mapper", "seed", "steps", "path_m", "updates", "surfaces",
    "position_error_m", "files",
}  # fmt: skip
Play = Callable[..., "Done"]
SHORT = ("--world", "square-loop", "--mapper", "odometry", "--steps", "40")


def _environment() -> dict[str, str]:
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return {**kept, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p), "COLUMNS": "100"}


@dataclass(frozen=True)
class Done:
    """How a call of the command ended."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def play(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., Done]:
    """Call `albot play` in an empty folder, without a display or a terminal."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)

    def call(*arguments: str) -> Done:
        monkeypatch.setattr(sys, "argv", ["albot", "play", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        shown = capsys.readouterr()
        return Done(int(ended.value.code or 0), shown.out, shown.err)

    return call


def test_an_episode_is_played_written_and_summed_up(play: Play, tmp_path: Path) -> None:
    done = play(*SHORT, "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert set(summary) >= KEYS
    assert (summary["steps"], summary["seed"], summary["agent"]) == (40, 1, "gap-explorer")
    assert summary["files"] == {"episode": "episode.mcap", "picture": "episode.png"}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["episode.mcap", "episode.png"]
    assert (tmp_path / "episode.png").read_bytes().startswith(b"\x89PNG")
    moments = list(EpisodeReader(tmp_path / "episode.mcap").moments())
    assert len(moments) == 41
    assert moments[-1].path_length == summary["path_m"]
    assert moments[-1].updates == summary["updates"]


def test_a_page_is_written_beside_the_episode_and_again_from_it(play: Play, tmp_path: Path) -> None:
    done = play(*SHORT, "--html", "a.html", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["files"]["page"] == "a.html"
    page = (tmp_path / "a.html").read_text()
    assert page.startswith("<!doctype html>")
    again = play("episode.mcap", "--headless", "--html", "b.html")
    assert "page     b.html" in again.stdout
    assert (tmp_path / "b.html").read_text() == page


def test_no_earlier_episode_is_overwritten(play: Play, tmp_path: Path) -> None:
    for number in ("", "-1", "-2"):
        (tmp_path / "episode-1.png").touch()  # One of somebody else's is enough.
        files = json.loads(play(*SHORT, "--json").stdout)["files"]
        name = {"": "episode", "-1": "episode-2", "-2": "episode-3"}[number]
        assert files == {"episode": f"{name}.mcap", "picture": f"{name}.png"}
    assert (tmp_path / "episode-1.png").read_bytes() == b""
    found = json.loads(play(*SHORT, "--record", "a.mcap", "--json").stdout)["files"]
    assert found == {"episode": "a.mcap", "picture": "episode-4.png"}


@pytest.mark.parametrize("option", ["--record", "--png"])
def test_a_file_that_was_named_is_overwritten_by_force_alone(
    play: Play, tmp_path: Path, option: str
) -> None:
    path = tmp_path / ("mine.mcap" if option == "--record" else "mine.png")
    path.write_text("mine")
    done = play(*SHORT, option, path.name)
    assert done.returncode == 2
    assert (
        done.stderr
        == f"albot: {path.name}: expected no existing file, or --force to overwrite it, found one\n"
    )
    assert path.read_text() == "mine"
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    assert play(*SHORT, option, path.name, "--force").returncode == 0
    assert path.stat().st_size > 1000


def test_people_get_a_summary_and_a_progress_line(play: Play, tmp_path: Path) -> None:
    done = play(*SHORT)
    assert done.returncode == 0, done.stderr
    for words in ("m driven", "updates", "surfaces", "m off", "1 room entered", "episode.mcap"):
        assert words in done.stdout
    assert "episode.png" in done.stdout
    assert done.stderr == ""  # It is too short for a line of progress.
    assert "\x1b" not in done.stdout


def test_the_same_seed_gives_the_same_files(play: Play, tmp_path: Path) -> None:
    for name in ("a", "b", "c"):
        seed = "3" if name == "c" else "2"
        files = ("--record", f"{name}.mcap", "--png", f"{name}.png")
        assert play(*SHORT, "--seed", seed, *files, "--json").returncode == 0
    read = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert read["a.mcap"] == read["b.mcap"] != read["c.mcap"]
    assert read["a.png"] == read["b.png"] != read["c.png"]


def test_a_recorded_episode_plays_back_to_the_same_end(play: Play, tmp_path: Path) -> None:
    ran = json.loads(play(*SHORT, "--json").stdout)
    words = ("--png", "again.png", "--figure", "paper.pdf")
    back = play("episode.mcap", *words, "--json")
    assert back.returncode == 0, back.stderr
    played = json.loads(back.stdout)
    assert played["files"]["figure"] == "paper.pdf"
    assert (tmp_path / "paper.pdf").read_bytes().startswith(b"%PDF")
    for key in KEYS - {"files"}:
        assert played[key] == ran[key], key
    assert played["files"]["picture"] == "again.png"
    assert (tmp_path / "again.png").read_bytes() == (tmp_path / "episode.png").read_bytes()


def test_a_torn_episode_plays_its_beginning_and_says_so(play: Play, tmp_path: Path) -> None:
    assert play(*SHORT, "--json").returncode == 0
    whole = (tmp_path / "episode.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(whole[: len(whole) // 2])
    back = play("torn.mcap", "--json")
    assert back.returncode == 0
    assert "torn.mcap: never closed, ends early; played up to its last" in back.stderr
    summary = json.loads(back.stdout)
    assert summary["torn"] is True
    assert 0 < summary["steps"] < 40


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (("--world", "office-rong"), "did you mean office-ring"),
        (("--mapper", "albot2"), "albot2"),
        (("--agent", "gap-explorer2"), "did you mean gap-explorer"),
        (("--odometer", "perfect"), "perfect"),
        (("--laser", "lms-20"), "did you mean lms-200"),
        (("--sonar", "loud"), "one of none, ideal, pioneer, poor"),
        (("--scenes", "papr"), "did you mean paper"),
        (("--seed", "-1"), "seed"),
        ((*SHORT, "--seed", str(2**128)), "seed: expected a whole number from 0 to 2¹²⁸ − 1"),
        (("--steps", "0"), "steps"),
        (("--speed", "0"), "speed"),
        (("--speed", "nan"), "speed"),
        ((*SHORT, "--png", "taken/a.png"), "taken"),
        ((*SHORT, "--png", "./episode.mcap"), "a file other than the episode"),
        ((*SHORT, "--png", "a.jpg"), "a name that ends in .png"),
        ((*SHORT, "--html", "a.htm"), "a name that ends in .html"),
        ((*SHORT, "--html", "taken/a.html"), "taken"),
        (
            (*SHORT, "--record", "a.txt"),
            "a name that ends in .mcap, found a.txt",
        ),
        (("--world", "two\nlines"), r"found two\nlines"),
        (("none.mcap",), "none.mcap"),
        ((*SHORT, "--record", "gone/a.mcap"), "expected an existing folder"),
        ((*SHORT, "--png", "gone/a.png"), "expected an existing folder"),
        ((*SHORT, "--record", "taken/a.mcap"), "taken"),
        (("--jsn",), "--json"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    play: Play, tmp_path: Path, arguments: tuple[str, ...], found: str
) -> None:
    (tmp_path / "taken").touch()
    done = play(*arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert len(done.stderr.strip().splitlines()) == 1
    assert done.stderr.startswith("albot: ")
    assert found in done.stderr
    assert not list(tmp_path.glob("episode.*"))


def test_a_picture_never_takes_the_place_of_the_episode(play: Play, tmp_path: Path) -> None:
    assert play(*SHORT, "--json").returncode == 0
    before = (tmp_path / "episode.mcap").read_bytes()
    done = play("episode.mcap", "--png", str(tmp_path / "episode.mcap"))
    assert done.returncode == 2
    assert "a file other than the episode" in done.stderr
    assert (tmp_path / "episode.mcap").read_bytes() == before


@pytest.mark.parametrize(
    ("option", "name"), [("--html", "a.html"), ("--video", "a.mp4"), ("--figure", "a.svg")]
)
def test_nothing_takes_the_place_of_the_episode(
    play: Play, tmp_path: Path, option: str, name: str
) -> None:
    assert play(*SHORT).returncode == 0
    (tmp_path / "episode.mcap").rename(tmp_path / name)
    before = (tmp_path / name).read_bytes()
    done = play(name, "--headless", "--force", option, name)
    assert (done.returncode, done.stdout) == (2, "")
    assert f"{option}: expected a file other than the episode" in done.stderr
    assert (tmp_path / name).read_bytes() == before


@pytest.mark.parametrize(
    "option",
    [("--world", "square-loop"), ("--laser", "short"), ("--sonar", "none"), ("--no-movables",)],
)
def test_options_of_a_run_do_not_go_with_a_recorded_one(
    play: Play, option: tuple[str, ...]
) -> None:
    done = play("a.mcap", *option)
    assert done.returncode == 2
    assert f"{option[0]}: expected no such option" in done.stderr


def test_the_robots_sensors_are_those_asked_for(play: Play) -> None:
    sensors = ("--laser", "lms-200-fine", "--sonar", "none", "--scenes", "ideal")
    assert play(*SHORT, "--agent", "random", *sensors).returncode == 0
    moments = list(EpisodeReader(Path("episode.mcap")).moments())
    assert {len(moment.reading.laser.ranges) for moment in moments} == {361}
    assert {moment.reading.sonar for moment in moments} == {None}
    assert any(moment.reading.scene is not None for moment in moments)
    assert play(*SHORT, "--sonar", "ideal", "--record", "episode.mcap", "--force").returncode == 0
    reader = EpisodeReader(Path("episode.mcap"))
    assert reader.header.sonar is not None
    assert all(moment.reading.scene is None for moment in reader.moments())


def test_things_move_unless_they_are_left_out(play: Play) -> None:
    world = ("--world", "random:apartment:1?people=1&boxes=1", "--mapper", "none", "--steps", "9")
    assert play(*world).returncode == 0
    moving = [moment.dynamic_obstacles for moment in EpisodeReader(Path("episode.mcap")).moments()]
    assert len(moving[0]) > 4
    assert not np.array_equal(moving[0], moving[-1])
    assert play(*world, "--no-movables").returncode == 0
    assert not any(
        len(moment.dynamic_obstacles) for moment in EpisodeReader(Path("episode-1.mcap")).moments()
    )


@pytest.mark.parametrize(
    ("option", "presets"),
    [
        ("--laser", LASERS),
        ("--odometer", ODOMETERS),
        ("--sonar", SONARS),
        ("--scenes", SCENES),
        ("--robot", ROBOTS),
    ],
)
def test_the_help_names_every_preset(play: Play, option: str, presets: Mapping[str, Any]) -> None:
    shown = play("--help").stdout.split(f" {option} TEXT")[1].split(" --")[0]
    assert set(presets) <= {word.strip(",.") for word in shown.split()}


@pytest.mark.parametrize("display", [{}, {"DISPLAY": ":987"}])
def test_in_a_terminal_the_map_is_drawn(display: dict[str, str], tmp_path: Path) -> None:
    arguments = ("play", *SHORT, "--speed", "1000")
    with Terminal(tmp_path, *arguments, environment=display) as terminal:
        terminal.wait_for("the truth")
        terminal.wait_for("the end · ×1000 · step 40 of 40")
        # All is written before anybody looks at the last picture for long.
        assert (tmp_path / "episode.png").exists()
        assert not _reader(tmp_path / "episode.mcap").torn
        terminal.type(" ")  # Drawn once more, as it stays.
        terminal.wait_for("Albot/Explore-v0 · agent gap-explorer")
        picture = terminal.wait_for(r"(?s).*?q close")[0]
        terminal.type("q")
        assert terminal.finish() == 0
    lines = picture.splitlines()
    assert len(lines) < 24
    assert max(map(len, lines)) <= 80
    assert sum(0x2800 < ord(character) < 0x2900 for character in picture) > 100
    assert any(arrow in picture for arrow in "→↗↑↖←↙↓↘")
    assert "━ surfaces" in picture


def _reader(path: Path) -> EpisodeReader:
    """A reader that has read all."""
    reader = EpisodeReader(path)
    assert list(reader.moments())
    return reader


WHO = [
    ("explore", "gap-explorer"),
    ("Albot/Explore-v0", "exploring"),
    ("homing", "albot1-homing"),
    ("homing", "homing"),
    ("homing", "homing-mapless"),
    ("explore-and-home", "round-trip"),
    ("place-recognition", "place-judge"),
    ("place-recognition", "place-recognition"),
]


@pytest.mark.parametrize(("task", "agent"), WHO)
def test_every_task_is_played_by_its_agents_and_played_back(
    play: Play, task: str, agent: str
) -> None:
    ran = play(task, "--agent", agent, "--world", "square-loop", "--steps", "12", "--json")
    assert ran.returncode == 0, ran.stderr
    summary = json.loads(ran.stdout)
    assert (summary["task"], summary["agent"]) == (find_task(task), agent)
    assert 0 < summary["steps"] <= 12
    header = EpisodeReader(Path("episode.mcap")).header
    shown = (header.environment, header.agent, header.world, header.mapper)
    assert shown == (summary["task"], agent, "square-loop", summary["mapper"])
    back = play("episode.mcap", "--png", "again.png", "--json")
    assert back.returncode == 0, back.stderr
    played = json.loads(back.stdout)
    assert {key: played[key] for key in KEYS - {"files"}} == {
        key: summary[key] for key in KEYS - {"files"}
    }
    assert Path("again.png").read_bytes() == Path("episode.png").read_bytes()


def test_the_way_out_is_told_and_drawn_beside_the_way_home(play: Play) -> None:
    words = ("--world", "square-loop", "--outward", "6..7", "--steps", "8")
    ran = play("homing", *words, "--json")
    assert ran.returncode == 0, ran.stderr
    summary = json.loads(ran.stdout)
    reader = EpisodeReader(Path("episode.mcap"))
    header, moments = reader.header, list(reader.moments())
    walked = np.hypot(*np.diff(header.way_out, axis=0).T).sum()
    assert walked == pytest.approx(summary["way_out_m"], abs=1e-6)
    assert summary["way_out_m"] == moments[0].path_length >= 6.0
    assert summary["driven_m"] == moments[-1].path_length - moments[0].path_length
    np.testing.assert_allclose(header.way_out[0], header.start[:2])
    np.testing.assert_allclose(header.way_out[-1], moments[0].pose[:2])
    frame = RecordedEpisode(Path("episode.mcap"), seekable=False).frame
    shape = next(shape for shape in lay_out(frame).truth.shapes if shape.label == "way out")
    assert shape.is_thin
    lengths = (
        f"{summary['driven_m']:.1f} m driven after {summary['way_out_m']:.1f} m on the way out"
    )
    assert lengths in play("episode.mcap", "--headless").stdout
    assert "way out" not in play(*SHORT).stdout


def test_a_tour_ends_with_its_last_stop_and_tells_the_recall(play: Play) -> None:
    words = ("place-recognition", "--world", "random:office:3", "--steps", "300")
    summary = json.loads(play(*words, "--json").stdout)
    assert summary["steps"] < 300
    assert summary["revisits"] > 0
    assert 0.0 <= summary["recall"] <= 1.0
    shown = play(*words).stdout
    assert f"of {summary['revisits']} seen again" in shown
    assert f"recall {summary['recall']:.3f} at precision" in shown
    back = RecordedEpisode(Path("episode.mcap"), seekable=False)
    assert back.steps == summary["steps"]


def test_an_outward_journey_of_no_length_still_leads_away(play: Play) -> None:
    words = ("homing", "--world", "square-loop", "--steps", "2", "--json")
    done = play(*words, "--outward", "0..0")
    note = "--outward 0..0: a journey goes on until the way home is 5 m long (`away`)\n"
    assert done.stderr.endswith(note)
    assert json.loads(done.stdout)["way_out_m"] >= 5.0
    assert "--outward" not in play(*words, "--outward", "6..7").stderr


def test_numbers_of_steps_are_written_as_people_do(play: Play) -> None:
    assert json.loads(play(*SHORT[:-1], "4e1", "--json").stdout)["steps"] == 40
    done = play(*SHORT[:-1], "4.5")
    assert done.stderr == "albot: Invalid value for '--steps': '4.5' is not a valid whole number.\n"


def test_a_twin_is_named_by_its_own_id(play: Play) -> None:
    words = ("--world", "square-loop", "--outward", "1..2", "--steps", "3")
    for done in (play("homing-revealed", *words), play("episode.mcap", "--headless")):
        assert done.returncode == 0, done.stderr
        assert "albot1-homing at Albot/HomingRevealed-v0 in square-loop" in done.stdout
    assert EpisodeReader(Path("episode.mcap")).header.environment == "Albot/HomingRevealed-v0"
    ran = play("homing-revealed", *words, "--json")
    assert json.loads(ran.stdout)["task"] == "Albot/HomingRevealed-v0"


def test_a_users_agent_file_is_watched_at_its_own_task(play: Play) -> None:
    Path("mine.albot").write_bytes(shipped_agents()["exploring"].read_bytes())
    done = play("--agent", "mine.albot", "--world", "square-loop", "--steps", "3", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["task"] == "Albot/Explore-v0"
    assert EpisodeReader(Path("episode.mcap")).header.agent == "mine.albot"


@pytest.mark.parametrize(
    ("arguments", "expected", "found"),
    [
        (("homing", "--agent", "exploring"), "one for Albot/Homing-v0: ", "exploring, which is"),
        (("homing", "--agent", "exploring"), "homing-mapless", "for Albot/Explore-v0"),
        (("explore", "--agent", "place-judge"), "one for Albot/Explore-v0: ", "place-judge"),
        (("place-recognition", "--agent", "keyboard"), "place-judge", "found keyboard"),
        (("hooming",), "explore-and-home (Albot/ExploreAndHome-v1)", "did you mean homing?"),
        (("--agent", "keyboard", "--headless"), "a window or a terminal", "--headless"),
        (("--agent", "keyboard", *SHORT), "a window or a terminal with keys", "neither"),
        (
            ("--mapper", "none", "--mapper-config", "a.yml"),
            "no such option for a robot without a mapper (--mapper none)",
            "found a.yml",
        ),
    ],
)
def test_who_does_not_fit_is_refused_by_name(
    play: Play, arguments: tuple[str, ...], expected: str, found: str
) -> None:
    done = play(*arguments)
    assert done.returncode == 2
    assert expected in done.stderr
    assert found in done.stderr
    assert not list(Path().iterdir())


def test_nothing_heavy_is_loaded_before_it_is_needed() -> None:
    code = (
        "import sys, albot_cli.play, albot_env.tasks.explore.env, albot_agents.registry;"
        "print([m for m in ('pygame', 'matplotlib', 'torch', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=_environment(), capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"
