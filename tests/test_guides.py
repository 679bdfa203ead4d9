"""The guides in docs/guides, followed word by word in a copy of the project.

Above each block of code stands the file that it makes, or the line of a file behind which, or in
place of which, it belongs. The last blocks are tried.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.conftest import ROOT

GUIDES = sorted(path for path in (ROOT / "docs/guides").glob("*.md") if path.name != "index.md")
FOLDERS = ("core", "maps", "agents", "albot_env", "scripts")
STEP = re.compile(r"^(?P<say>[^\n]+:)\n\n```(?P<language>\w+)\n(?P<code>.*?)^```$", re.M | re.S)
NEW = re.compile(r"New file `([^`]+)`:")
EDIT = re.compile(r"In `([^`]+)`, (behind|in place of) `([^`]+)`:")


class Trial(NamedTuple):
    """What a guide asks the reader to run."""

    language: str
    code: str


def _follow(guide: str, copy: Path) -> list[Trial]:
    """Do what the guide says, and return what it asks to try."""
    trials = []
    for step in STEP.finditer(guide):
        say, code = step["say"], step["code"]
        if new := NEW.fullmatch(say):
            path = copy / new[1]
            assert not path.exists()
            path.write_text(code, encoding="utf-8")
        elif edit := EDIT.fullmatch(say):
            path, line = copy / edit[1], edit[3] + "\n"
            text = path.read_text(encoding="utf-8")
            assert f"\n{text}".count(f"\n{line}") == 1, f"{edit[1]} has no single line {edit[3]!r}"
            path.write_text(text.replace(line, (line if edit[2] == "behind" else "") + code))
        else:
            assert say.startswith("Try it"), say
            trials.append(Trial(step["language"], code))
    return trials


@pytest.mark.parametrize("guide", GUIDES, ids=lambda path: path.stem)
def test_a_guide_can_be_followed(guide: Path, tmp_path: Path) -> None:
    copy, here = tmp_path / "copy", tmp_path / "here"
    for folder in FOLDERS:
        shutil.copytree(ROOT / folder, copy / folder)
    here.mkdir()
    text = guide.read_text(encoding="utf-8")
    trials = _follow(text, copy)
    assert trials
    assert len(STEP.findall(text)) == text.count("```") // 2, "a block says not what it is for"
    command = here / "albot"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m albot_cli.main "$@"\n')
    command.chmod(0o755)
    paths = os.pathsep.join(str(copy / folder) for folder in (*FOLDERS[:3], "scripts", "."))
    place = {"PATH": f"{here}:{Path(sys.executable).parent}:{os.environ['PATH']}"}
    run_in = {**os.environ, **place, "PYTHONPATH": paths, "SDL_VIDEODRIVER": "dummy"}
    for trial in trials:
        shell = ["bash", "-euo", "pipefail", "-c"]
        words = shell if trial.language == "bash" else [sys.executable, "-W", "error", "-c"]
        done = subprocess.run(
            [*words, trial.code], cwd=here, env=run_in, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
