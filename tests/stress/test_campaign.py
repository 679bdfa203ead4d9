"""Campaigns as files: what runs, and everything that is wrong with them at once, with lines."""

from __future__ import annotations

import shutil
from pathlib import Path

import jsonschema
import pytest

from albot_agents.trained.trained_agent import shipped_agents
from albot_core.errors import InputError
from albot_stress.campaign import (
    Campaign,
    CampaignError,
    MapperChoice,
    read_campaign,
    read_schema,
)
from albot_stress.running import Checks

FULL = """\
task: explore
worlds: ["random:maze?columns=4", square-loop]
count: 2
seed: 7
steps: 5
agents: [gap-explorer, random]
mappers: [none, {name: odometry, config: few.yaml}]
odometers: [pioneer, ideal]
faults: [none, "laser-dropout:at=1m"]
robot: kobuki
movables: false
checks: {beams: 1, maps_every: 2, beliefs: 0.5, replays: 0}
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "campaign.yml"
    path.write_text(text)
    return path


def test_a_file_with_everything(tmp_path: Path):
    (tmp_path / "few.yaml").write_text("capacity: 7\n")
    campaign = read_campaign(written(tmp_path, FULL))
    episodes = campaign.episodes()
    assert len(episodes) == 2 * 2 * 2 * 2 * 2 * 2
    assert len(set(map(repr, episodes))) == len(episodes)
    assert campaign.checks == Checks(beams=1.0, maps_every=2, beliefs=0.5, replays=0.0)
    assert campaign.mappers[0] == MapperChoice("none")
    assert campaign.mappers[1].config.capacity == 7
    last = episodes[-1]
    assert (last.world, last.seed, last.agent, last.steps) == ("square-loop", 8, "random", 5)
    assert last.faults is not None
    command = last.command(3)
    assert f"--mapper-config {tmp_path / 'few.yaml'}" in command
    for words in ("--robot kobuki", "--odometer ideal", "--no-movables", "--faults"):
        assert words in command
    assert episodes[0].command(3) == (
        "albot play --world 'random:maze:7?columns=4' --agent gap-explorer --mapper none "
        "--robot kobuki --odometer pioneer --seed 7 --steps 3 --no-movables"
    )


def test_files_lie_beside_the_campaign(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    folder = tmp_path / "with ä space"
    folder.mkdir()
    shutil.copy(shipped_agents()["exploring"], folder / "mine.albot")
    shutil.copy(shipped_agents()["exploring"], folder / "random")  # No agent of the project's.
    monkeypatch.chdir(tmp_path)
    text = "worlds: [square-loop]\nagents: [mine.albot, random]\nmappers: [albot1]\ncount: 1\n"
    campaign = read_campaign(written(folder, text).relative_to(tmp_path))
    assert campaign.agents == (str(Path(folder.name, "mine.albot")), "random")


def test_no_seed_is_too_large_for_a_row():
    Campaign(worlds=("square-loop",), agents=("random",), seed=2**64 - 2, count=2).check()
    campaign = Campaign(worlds=("square-loop",), agents=("random",), seed=2**64 - 2, count=3)
    with pytest.raises(InputError, match=f"seed: expected {2**64 - 3} or less, because 3 are"):
        campaign.check()


def test_an_empty_file_is_the_default(tmp_path: Path):
    assert read_campaign(written(tmp_path, "# nothing\n")) == Campaign()


def test_the_schema_says_all_that_a_campaign_has():
    schema = read_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    assert set(schema["properties"]) == set(Campaign.__dataclass_fields__)
    checks = set(Checks.__dataclass_fields__) - {"limits"}
    assert set(schema["properties"]["checks"]["properties"]) == checks


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (
            "worlds: [random]\ncuont: 6\nsteps: 0\nchecks: {beams: 2}\nmappers: [3]\n",
            [
                "line 2, cuont: expected keys among",
                "line 3, steps: expected 1 or more, found 0",
                "line 4, checks.beams: expected 1 or less, found 2",
                "line 5, mappers[0]: expected a name, or a mapping with name and config, found 3",
            ],
        ),
        (
            "worlds: [random:ofice]\nagents:\n- random\n- albot1-homing\n- randm\n"
            "mappers: [none, none]\nodometers: [pionere]\nfaults: [laser-dropot]\nrobot: r2d2\n",
            [
                "line 1, worlds[0], random world: expected one of the kinds",
                "line 4, agents[1], agent: expected one for Albot/Explore-v0",
                "line 5, agents[2], agent: expected one of",
                "line 6, mappers[1], mappers: expected each entry once, found none twice",
                "line 7, odometers[0], odometer: expected one of ideal",
                "line 8, faults[0], faults: expected faults among",
                "line 9, robot",
            ],
        ),
        (
            "worlds: [square-loop]\nagents:\n- random\n- exploring\n"
            "mappers: [none, ratslam-scenes]\n",
            [
                "line 3, agents[0], agent random, mapper ratslam-scenes",
                "line 4, agents[1], agent exploring, mapper none",
                "line 4, agents[1], agent exploring, mapper ratslam-scenes",
            ],
        ),
        (
            "task: place-recognition\nworlds: [square-loop]\nagents: [place-judge]\n"
            "mappers: [albot1]\n",
            ["line 3, agents[0], agent place-judge, mapper albot1, task: expected one in which"],
        ),
        (
            "task: exploer\nworlds: [square-loop]\nrobot: kobuky\nagents: [albot1-homing, randm]\n",
            [
                "line 1, task: expected one of",
                "line 3, robot: expected one of",
                "line 4, agents[1], agent: expected one of",
            ],
        ),
        (f"worlds: [{'x' * 400}]\n", ["line 1, worlds[0], world: expected a file,"]),
        ("[1, 2]\n", ["line 1: expected a mapping, found [1, 2]"]),
    ],
)
def test_all_errors_are_told_at_once_with_their_lines(text: str, lines: list[str], tmp_path: Path):
    path = written(tmp_path, text)
    with pytest.raises(CampaignError) as caught:
        read_campaign(path)
    found = str(caught.value).splitlines()
    assert len(found) == len(lines)
    for line, expected in zip(found, lines, strict=True):
        assert line.startswith(f"{path}, {expected}")


def test_a_file_that_is_no_yaml(tmp_path: Path):
    with pytest.raises(InputError, match="line 1"):
        read_campaign(written(tmp_path, "worlds: [random"))
    with pytest.raises(InputError, match="not found"):
        read_campaign(tmp_path / "gone.yml")
