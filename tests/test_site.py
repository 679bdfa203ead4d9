"""The documentation as a site: links that lead into it, pages from the code, and tutorials."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import click
import nbformat
import pytest
import yaml
from PIL import Image

from albot_agents.registry import agent_names
from albot_agents.task import config_kind, task_names
from albot_agents.training.plan_file import read_plan
from albot_cli.config import parameter_rows
from albot_cli.group import SUBCOMMANDS, albot
from albot_core.errors import InputError
from albot_core.mappers.registry import MAPPERS
from albot_env.recording.schemas import TOPICS
from albot_maps.generators.spec import KINDS
from albot_site.command_line import command_line_page
from albot_site.configurations import configuration_pages, own_tasks
from albot_site.film import film
from albot_site.formats import format_pages
from albot_site.gallery import Shot, draw, gallery_page, shots
from albot_site.reference import api_pages
from albot_site.sources import addresses, modules, relink
from albot_site.tutorials import notebooks, read_cells, run_cells
from tests.conftest import ROOT
from tests.env.rendering.test_video import read_mp4

LINK = re.compile(r"\[[^\]]*\]\(([^)\s#]+)")


@pytest.mark.parametrize(
    ("source", "address", "link", "expected"),
    [
        ("docs/agents.md", "agents.md", "../agents/albot_agents/agent.py#Agent",
         "reference/api/albot_agents.agent.md#Agent"),
        ("docs/guides/agent.md", "guides/agent.md", "../../CONTRIBUTING.md",
         "../develop/contributing.md"),
        ("README.md", "index.md", "docs/worlds.md#the-command", "worlds.md#the-command"),
        ("CONTRIBUTING.md", "develop/contributing.md", "docs/kernels.md", "../kernels.md"),
        ("docs/training.md", "training.md", "plans", "reference/plans.md"),
        ("docs/start/log.md", "start/log.md", "../tutorials/add_a_task.ipynb",
         "../tutorials/add_a_task.md"),
        # What lies in docs/ stays, and so does what is nowhere: a strict build reports it.
        ("docs/start/log.md", "start/log.md", "../logs.md", "../logs.md"),
        ("docs/logs.md", "logs.md", "../nowhere.py", "../nowhere.py"),
        ("docs/logs.md", "logs.md", "https://mcap.dev", "https://mcap.dev"),
    ],
)  # fmt: skip
def test_links_to_files_outside_docs_lead_into_the_site(
    source: str, address: str, link: str, expected: str
) -> None:
    text = f"See [this `one`]({link}).\n\n```\n[code]({link})\n```\n"
    shown = relink(text, source, address, addresses())
    assert shown == f"See [this `one`]({expected}).\n\n```\n[code]({link})\n```\n"


@pytest.mark.parametrize("page", ["README.md", "CONTRIBUTING.md", "CHANGELOG.md"])
def test_the_pages_beside_docs_lead_to_files_that_there_are(page: str) -> None:
    """As a code host shows them; those of docs/ are held by the strict build."""
    text = (ROOT / page).read_text(encoding="utf-8")
    links = [link for link in LINK.findall(text) if "://" not in link]
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []


def test_each_public_module_has_a_page_and_packages_list_theirs() -> None:
    pages = api_pages()
    assert len(pages) == len(dict(modules()))
    assert "::: albot_core.logs.carmen\n" in pages["reference/api/albot_core.logs.carmen.md"]
    package = pages["reference/api/albot_core.logs.md"]
    assert "| [albot_core.logs.duke](albot_core.logs.duke.md) | Logs of Duke" in package
    assert "albot_core.logs.duke" not in pages["reference/api/albot_core.md"]


def test_the_page_of_the_command_has_each_subcommand_and_option() -> None:
    page = command_line_page()
    for name in SUBCOMMANDS:
        assert f"\n## albot {name}\n" in page
    context = click.Context(albot)
    play = albot.get_command(context, "play")
    assert play is not None
    for option in play.params:
        if isinstance(option, click.Option):
            assert option.opts[-1] in page


def test_the_pages_of_configurations_have_each_field() -> None:
    pages = configuration_pages()
    assert own_tasks() == [task for task in task_names() if "Revealed" not in task]
    for task in own_tasks():
        section = pages["reference/tasks.md"].split(f"## {task}\n")[1].split("\n## ")[0]
        rows = parameter_rows(config_kind(task)())
        named = re.findall(r"^\| `([^`]+)` \|", section, re.MULTILINE)
        assert named == [row["name"] for row in rows]
    assert re.findall(r"^## (\S+)$", pages["reference/mappers.md"], re.MULTILINE) == [*MAPPERS]
    assert [f"random:{kind}" for kind in KINDS] == re.findall(
        r"^## (\S+)$", pages["reference/random_worlds.md"], re.MULTILINE
    )
    for page in pages.values():
        columns = {
            len(re.findall(r"(?<!\\)\|", line))
            for line in page.splitlines()
            if line.startswith("| `") and line.count(" | ") > 1
        }
        assert columns <= {5}


def test_the_schemas_on_the_pages_of_formats_are_those_of_the_code() -> None:
    blocks = re.findall(
        r"^```json\n(.*?)^```$", format_pages()["reference/episode_files.md"], re.M | re.S
    )
    assert {json.loads(block)["title"] for block in blocks} == {
        schema["title"] for schema in TOPICS.values()
    }


def test_the_gallery_shows_everything_by_commands_that_can_be_called(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    all_shots = list(shots())
    assert len({shot.file for shot in all_shots}) == len(all_shots)
    shown = {shot.name for shot in all_shots}
    assert {*MAPPERS, *agent_names(), *(f"random:{kind}:1" for kind in KINDS)} <= shown
    page = gallery_page()
    monkeypatch.setattr(click.Command, "invoke", lambda *_: None)
    for shot in all_shots:
        assert f"`{shot.command}`" in page
        albot.main(shot.command.split()[1:], standalone_mode=False)


def test_a_picture_of_the_gallery_is_drawn_by_its_command(tmp_path: Path) -> None:
    shot = next(shot for shot in shots() if shot.name == "random:maze:1")
    draw(shot, tmp_path)
    (drawn,) = tmp_path.iterdir()
    with Image.open(drawn) as picture:
        assert picture.size[0] <= 1000
        assert len(picture.convert("RGB").getcolors(1 << 16) or ()) > 1
    assert drawn.stat().st_size < 100_000


def test_what_acts_has_a_clip_beside_its_picture(tmp_path: Path) -> None:
    shot = Shot(
        group="Agents",
        name="one",
        text="",
        command="albot play explore --world square-loop --mapper odometry --headless --steps 20",
    )
    draw(shot, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"agents-one.png", "agents-one.mp4"}
    pictures, _ = read_mp4(tmp_path / "agents-one.mp4")
    assert len(pictures) > 1


def test_the_film_moves(tmp_path: Path) -> None:
    path = tmp_path / "film.gif"
    assert film(path, world="square-loop", seed=1, steps=30, every=10) == 4
    with Image.open(path) as pictures:
        assert pictures.n_frames == 4  # type: ignore[attr-defined]
        first = pictures.convert("RGB").tobytes()
        pictures.seek(3)
        assert pictures.convert("RGB").tobytes() != first
    with pytest.raises(InputError, match="nowhere"):
        film(path, world="nowhere", seed=1, steps=1, every=1)


@pytest.mark.parametrize("notebook", notebooks(), ids=lambda path: path.stem)
def test_a_tutorial_runs_and_is_kept_without_outputs(notebook: Path, tmp_path: Path) -> None:
    """In a process of its own, as in Jupyter."""
    nbformat.validate(nbformat.read(notebook, as_version=4))
    words = [sys.executable, "-m", "albot_site", "tutorial", str(notebook), "--out", str(tmp_path)]
    run = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert list(tmp_path.glob("*.txt"))


def test_a_notebook_with_outputs_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "kept.ipynb"
    cell = {"cell_type": "code", "source": ["1"], "outputs": [{}], "execution_count": 1}
    path.write_text(json.dumps({"cells": [cell]}))
    with pytest.raises(InputError, match="cell 1"):
        list(read_cells(path))


def test_an_error_in_a_cell_is_the_readers_too(tmp_path: Path) -> None:
    path = tmp_path / "wrong.ipynb"
    cells = [{"cell_type": "code", "source": ["print('a')\n", "1 / 0"]}]
    path.write_text(json.dumps({"cells": cells}))
    with pytest.raises(ZeroDivisionError):
        run_cells(path, tmp_path)


def test_each_document_is_in_the_navigation() -> None:
    """The strict build says so, too; this is told within seconds."""
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    named = set(re.findall(r"[\w/]+\.md", str(yaml.safe_load(text)["nav"])))
    pages = {
        path.relative_to(ROOT / "docs").as_posix()
        for path in (ROOT / "docs").rglob("*.md")
        if path.name != "report.md"
    }
    assert pages <= named


def test_the_plan_of_the_first_training_is_a_plan(tmp_path: Path) -> None:
    page = (ROOT / "docs/start/training.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```yaml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    path = tmp_path / "first.yml"
    path.write_text(text)
    assert read_plan(path).n_timesteps == 16384
