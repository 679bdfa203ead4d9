"""`albot --install-completion`: what it writes, and that shells complete by it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from albot_cli.group import albot
from albot_cli.shell_scripts import SHELLS
from albot_core.errors import InputError

SCRIPTS = {
    "bash": ".local/share/bash-completion/completions/albot",
    "fish": ".config/fish/completions/albot.fish",
    "zsh": ".local/share/albot/completion.zsh",
}
STARTUPS = {"bash": ".bashrc", "zsh": ".zshrc"}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user's empty folder."""
    home = tmp_path / "it's home"
    home.mkdir()
    for variable in ("XDG_DATA_HOME", "XDG_CONFIG_HOME", "ZDOTDIR"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("HOME", str(home))
    return home


def _call(*words: str) -> Result:
    return CliRunner().invoke(albot, list(words))


@pytest.mark.parametrize("shell", SHELLS)
def test_it_writes_what_it_shows_once(
    shell: str, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHELL", f"/usr/bin/{shell}")
    startup = home / STARTUPS.get(shell, "none")
    if shell in STARTUPS:
        startup.write_bytes(b"alias \xff=ls")  # No newline at its end, and no UTF-8.
        startup.chmod(0o600)
    first = _call("--install-completion")
    assert first.exit_code == 0, first.output
    script = home / SCRIPTS[shell]
    assert script.read_text().strip() == _call("--show-completion", shell).stdout.strip()
    assert f"written    {script}" in first.stdout
    again = _call("--install-completion", shell)
    assert f"unchanged  {script}" in again.stdout
    assert "written" not in again.stdout
    if shell in STARTUPS:
        assert f"line added {startup}" in first.stdout
        lines = startup.read_bytes().splitlines()
        assert lines[0] == b"alias \xff=ls"
        assert len(lines) == 2
        assert startup.stat().st_mode & 0o777 == 0o600


def test_it_goes_where_the_environment_says(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(home / "data"))
    monkeypatch.setenv("ZDOTDIR", str(home / "dots"))
    assert _call("--install-completion", "zsh").exit_code == 0
    assert (home / "data/albot/completion.zsh").exists()
    assert (home / "dots/.zshrc").exists()
    monkeypatch.setenv("XDG_DATA_HOME", "relative")
    assert _call("--install-completion", "bash").exit_code == 0
    assert (home / SCRIPTS["bash"]).exists()


@pytest.mark.parametrize("shell", ["", "/bin/tcsh"])
def test_an_unknown_shell_is_refused(
    shell: str, home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SHELL", shell)
    for option in ("--install-completion", "--show-completion"):
        refused = _call(option)
        assert isinstance(refused.exception, InputError)
        assert "bash, fish, zsh" in str(refused.exception)
    assert not list(home.iterdir())


def test_a_folder_that_is_a_file_is_refused_before_the_startup_file_changes(home: Path) -> None:
    (home / ".local").touch()
    refused = _call("--install-completion", "bash")
    assert isinstance(refused.exception, InputError)
    assert not (home / ".bashrc").exists()


ASKED = {
    "bash": "source ~/.bashrc; COMP_WORDS=(albot map); COMP_CWORD=1; _albot_completion albot; "
    'echo "${COMPREPLY[@]}"',
    "zsh": "source ~/.zshrc; echo $_comps[albot] mappers",
    "fish": "complete -C 'albot map'",
}


@pytest.mark.parametrize("shell", SHELLS)
def test_a_shell_completes_by_it(shell: str, home: Path) -> None:
    program = shutil.which(shell)
    if program is None:
        pytest.skip(f"no {shell} here")
    assert _call("--install-completion", shell).exit_code == 0
    installed = Path(sys.executable).parent
    run = subprocess.run(
        [program, "-c", ASKED[shell]],
        env={**os.environ, "PATH": f"{installed}:{os.environ['PATH']}"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "mappers" in run.stdout, run.stderr
