"""`albot play --video` and `--grid`: how many pictures, of what, and what is refused."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable
from math import ceil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from albot_cli import film as module
from albot_cli.film import film
from albot_env.recording.reader import EpisodeReader
from albot_env.rendering import video
from albot_env.rendering.mosaic import tile_size
from albot_env.rendering.video import VideoWriter
from tests.cli.test_play import SHORT, Done, Play, _environment, play
from tests.env.rendering.test_video import read_mp4
from tests.processes import ALBOT, running, wait_until

assert play  # The fixture.
ROOM = ("--world", "square-loop", "--mapper", "odometry", "--steps", "12")


class Clockwork:
    """Steps of given lengths (s)."""

    def __init__(self, *lengths: float) -> None:
        self._lengths, self.step, self.time = lengths, 0, 0.0

    @property
    def over(self) -> bool:
        return self.step == len(self._lengths)

    def advance(self) -> None:
        self.time += self._lengths[self.step]
        self.step += 1


class Reel(VideoWriter):
    """Notes which moments were shown, and how often."""

    def __init__(self, rate: int) -> None:
        self.rate, self.count = rate, 0
        self.shown: list[int] = []

    def add(self, picture: np.ndarray, count: int = 1) -> None:
        self.shown += [int(picture[0, 0, 0])] * count
        self.count += count


def filmed(steps: Clockwork, speed: float, rate: int = 20) -> list[int]:
    reel = Reel(rate)
    ticks: list[int] = []

    def capture() -> Callable[[], np.ndarray]:
        picture = np.full((2, 2, 3), steps.step, np.uint8)
        return lambda: picture

    film(steps, reel, capture, speed=speed, update=lambda: ticks.append(1))
    assert len(ticks) == steps.step
    *before, last = np.split(np.array(reel.shown), [-rate])
    assert set(last.tolist()) == {steps.step}  # It stays for a second.
    return [int(number) for number in before[0]]


@pytest.mark.parametrize(
    ("speed", "expected"),
    [
        (10.0, [0, 5, 10, 15, 20, 25]),
        (2.0, list(range(30))),
        (1.0, [k // 2 for k in range(60)]),
        (1000.0, [0]),
        (0.5, [k // 4 for k in range(120)]),
    ],
)
def test_a_picture_shows_the_moment_of_its_time(speed: float, expected: list[int]) -> None:
    assert filmed(Clockwork(*[0.1] * 30), speed) == expected


def test_a_step_of_minutes_lasts_a_second() -> None:
    assert filmed(Clockwork(300.0, 5.0, 60.0), 10.0) == [0] * 20 + [1] * 10 + [2] * 20
    assert module.LONGEST_STEP == 10.0


def test_an_episode_without_steps_is_its_last_moment() -> None:
    assert filmed(Clockwork(), 10.0) == []


def test_an_episode_is_filmed_live_and_from_its_file(play: Play) -> None:
    done = play(*SHORT, "--video", "live.mp4", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["files"]["video"] == "live.mp4"
    pictures, rate = read_mp4(Path("live.mp4"))
    assert rate == video.RATE
    assert len(pictures) == ceil(4.0 / 10 * rate) + rate == 28
    assert pictures[0].shape == (640, 1200, 3)
    assert np.abs(pictures[-1].astype(int) - pictures[-10]).mean() < 0.1
    assert np.abs(pictures[0].astype(int) - pictures[-1]).max() > 100
    again = play("episode.mcap", "--video", "again.mp4", "--json")
    assert again.returncode == 0, again.stderr
    for one, other in zip(pictures, read_mp4(Path("again.mp4"))[0], strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_gif_at_another_speed(play: Play) -> None:
    done = play(*SHORT, "--video", "a.gif", "--speed", "4")
    assert done.returncode == 0, done.stderr
    assert "  video    a.gif" in done.stdout
    with Image.open("a.gif") as gif:
        assert (gif.n_frames, gif.size) == (4.0 / 4 * video.RATE + video.RATE, (1200, 640))


def test_a_guided_tour_is_no_video_of_one_picture(play: Play) -> None:
    words = ("place-recognition", "--world", "square-loop", "--steps", "4", "--video", "a.gif")
    assert play(*words, "--json").returncode == 0
    stamps = [moment.reading.stamp for moment in EpisodeReader(Path("episode.mcap")).moments()]
    shown = np.minimum(np.diff(stamps), 10.0).sum() / 10
    with Image.open("a.gif") as gif:
        assert gif.n_frames == ceil(shown * video.RATE - 1e-6) + video.RATE > 2 * video.RATE


@pytest.mark.parametrize(
    ("arguments", "found"),
    [
        (("--video", "a.avi"), "--video: expected a name that ends in .mp4 or .gif, found a.avi"),
        (("--video", "gone/a.mp4"), "expected an existing folder"),
        (("--video", "mine.mp4"), "or --force to overwrite it"),
        (("--video", "a.mp4", "--agent", "keyboard"), "a window or a terminal, found --video"),
        (("--grid", "3"), "expected COLUMNSxROWS, as 3x3"),
        (("--grid", "0x3"), "expected from 1x1 to 10x10 tiles"),
        (("--grid", "11x1"), "expected from 1x1 to 10x10 tiles"),
        (("--grid", "-1x2"), "expected COLUMNSxROWS"),
        (("--grid", "2x2", "--record", "a.mcap"), "--record: expected no such option with --grid"),
        (("--grid", "2x2", "--figure", "a.pdf"), "--figure: expected no such option with --grid"),
        (("--grid", "2x2", "--agent", "keyboard"), "expected one episode, found --grid 2x2"),
        (("a.mcap", "--grid", "2x2"), "--grid: expected no such option when an episode is"),
        (("--grid", "2x2", "--world", "office-rong"), "did you mean office-ring"),
        (("--grid", "2x1", "--png", "a.jpg"), "a name that ends in .png"),
    ],
)
def test_bad_input_is_one_line(
    play: Play, tmp_path: Path, arguments: tuple[str, ...], found: str
) -> None:
    (tmp_path / "mine.mp4").write_text("mine")
    done = play(*arguments)
    assert done.returncode == 2
    assert len(done.stderr.strip().splitlines()) == 1
    assert found in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["mine.mp4"]
    assert (tmp_path / "mine.mp4").read_text() == "mine"


def test_without_the_extra_a_line_says_what_to_install(
    play: Play, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(video, "find_spec", lambda name: None)
    done = play(*SHORT, "--video", "a.mp4")
    expected = "the package of the extra `video` (pip install 'albot-env[video]'), found no av"
    assert (done.returncode, done.stderr) == (2, f"albot: --video: expected {expected}\n")
    assert not list(tmp_path.iterdir())


def test_ctrl_c_leaves_the_episode_and_no_video(tmp_path: Path) -> None:
    words = ("play", *SHORT[:-1], "100000", "--video", "a.mp4", "--speed", "0.2")
    with running([*ALBOT, *words], tmp_path, _environment()) as process:
        wait_until(lambda: any(tmp_path.glob(".a.mp4.*")))  # The unfinished video.
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"episode.mcap holds the episode up to here" in err
    assert [path.name for path in tmp_path.iterdir()] == ["episode.mcap"]


def test_a_grid_is_one_picture_and_one_video(play: Play, tmp_path: Path) -> None:
    done = play(
        *ROOM, "--grid", "2x2", "--seed", "5", "--png", "a.png", "--video", "a.mp4", "--json"
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["files"] == {"picture": "a.png", "video": "a.mp4"}
    assert [row["seed"] for row in summary["episodes"]] == [5, 6, 7, 8]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mp4", "a.png"]
    width, height = tile_size(2)
    with Image.open("a.png") as image:
        whole = np.asarray(image)
    assert whole.shape == (2 * height, 2 * width, 3)
    pictures, _ = read_mp4(Path("a.mp4"))
    assert len(pictures) == ceil(1.2 / 10 * video.RATE) + video.RATE
    assert np.abs(pictures[-1].astype(int) - whole).mean() < 6
    # The same episode alone: the figures are the same, and the tile is.
    alone = json.loads(play(*ROOM, "--seed", "8", "--json").stdout)
    (row,) = (row for row in summary["episodes"] if row["seed"] == 8)
    for key in ("steps", "path_m", "position_error_m", "reward", "simulated_s"):
        assert row[key] == alone[key]


def test_in_random_worlds_each_tile_is_another(play: Play) -> None:
    words = ("homing", "--world", "random:apartment", "--outward", "1..2", "--steps", "3")
    done: Done = play(*words, "--mapper", "odometry", "--grid", "2x1", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert [row["world"] for row in summary["episodes"]] == [
        "apartment-1",
        "apartment-2",
    ]
    assert [row["success"] for row in summary["episodes"]] == [False, False]
    assert summary["files"] == {"picture": "episode.png", "video": None}
    told = play(*words, "--mapper", "odometry", "--grid", "2x1")
    assert "  seed 2 " in told.stdout
    assert "no success" in told.stdout
    assert Path("episode-1.png").exists()
