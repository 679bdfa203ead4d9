"""What may be written where: found out before the work, and all or nothing after it."""

from __future__ import annotations

import os
import re
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from albot_cli.outputs import (
    FORCE,
    FigureFile,
    check_file,
    check_folder,
    check_png,
    figure_options,
    filled_folder,
)
from albot_core.errors import InputError


def test_a_file_may_be_new_or_written_over_if_that_is_said(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    check_file(path)
    path.write_text("mine")
    check_file(path, force=True)
    with pytest.raises(InputError, match=r"a\.txt: expected no existing file, or --force"):
        check_file(path)
    assert path.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize(
    ("place", "message"),
    [
        ("nowhere", "an existing folder .*nowhere, found none"),
        ("nowhere/on", "an existing folder .*on, found none"),
        ("file", "a file to write, found Not a directory"),
    ],
)
def test_a_file_needs_a_folder(tmp_path: Path, place: str, message: str, force: bool) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=rf"a\.txt: expected {message}$"):
        check_file(tmp_path / place / "a.txt", force=force)
    with pytest.raises(InputError, match=rf"a\.png: expected {message}$"):
        check_png(tmp_path / place / "a.png", force=force)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="needs a folder nobody may write to")
def test_a_folder_in_which_nothing_can_be_made_is_told(tmp_path: Path) -> None:
    """Not even by the system's administrator, as whom tests may run."""
    closed = Path("/proc/self")
    with pytest.raises(InputError, match=r"a\.txt: expected a file to write, found \w"):
        check_file(closed / "a.txt")
    with pytest.raises(InputError, match=r"expected a folder to write to, found \w"):
        check_folder(closed)
    link = tmp_path / "a.txt"
    link.symlink_to(closed / "a.txt")  # It counts where the file would really be.
    with pytest.raises(InputError, match="expected a file to write"):
        check_file(link)


def test_what_is_no_file_of_the_disk_is_not_checked() -> None:
    check_file(Path(os.devnull))


def test_a_folder_is_refused_for_a_file_in_it_that_exists(tmp_path: Path) -> None:
    check_folder(tmp_path / "new", ["a.md"])
    check_folder(tmp_path / "new" / "newer", ["a.md"])
    (tmp_path / "a.md").write_text("mine")
    check_folder(tmp_path, ["b.md"])
    check_folder(tmp_path, ["b.md", "a.md"], force=True)
    for folder, message in (
        (tmp_path, "no existing file"),
        (tmp_path / "a.md" / "b" / "c", "a folder to write to, found a file at"),
    ):
        with pytest.raises(InputError, match=message):
            check_folder(folder, ["b.md", "a.md"])
    with pytest.raises(InputError, match="a folder to write to, found a file at"):
        check_folder(tmp_path / "a.md")


def test_a_folder_is_filled_at_the_end_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    with pytest.raises(ZeroDivisionError), filled_folder(folder) as scratch:
        (scratch / "a.md").write_text("one")
        raise ZeroDivisionError
    assert not folder.exists()
    with filled_folder(folder) as scratch:
        for name in ("a.md", "b.md"):
            (scratch / name).write_text(name)
        assert not folder.exists()
    assert {path.name: path.read_text() for path in folder.iterdir()} == {
        "a.md": "a.md",
        "b.md": "b.md",
    }


@click.command()
@click.option("--png", type=Path)
@figure_options("a square")
@FORCE
def draw(png: Path | None, figure: FigureFile | None, force: bool) -> None:
    """Tell what is to be drawn."""
    click.echo(f"{png} {figure and (figure.path.name, figure.dpi)} {force}")


def drawn(*words: object) -> Result:
    return CliRunner().invoke(draw, [*map(str, words)])


def test_a_figure_has_300_dots_an_inch_or_as_many_as_asked_for(tmp_path: Path) -> None:
    assert drawn().output == "None None False\n"
    assert drawn("--figure", tmp_path / "a.pdf").output == "None ('a.pdf', 300) False\n"
    found = drawn("--figure", tmp_path / "a.SVG", "--dpi", 150)
    assert found.output == "None ('a.SVG', 150) False\n"
    assert FigureFile(tmp_path / "a.pdf", 300).named("b").path == tmp_path / "a-b.pdf"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--figure", "a.jpg"), r"--figure: expected a name that ends in \.png, \.pdf or \.svg"),
        (("--figure", "none/a.pdf"), r"none/a\.pdf: expected an existing folder"),
        (("--figure", "old.pdf"), r"old\.pdf: expected no existing file, or --force"),
        (("--figure", "a.png", "--png", "a.png"), "--figure: expected a file other than that of"),
        (("--dpi", "300"), "--dpi: expected --figure FILE"),
    ],
)
def test_a_figure_that_cannot_be_is_told_before_the_work(
    words: tuple[str, ...], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("old.pdf").write_text("")
    result = drawn(*words)
    assert result.output == ""
    assert isinstance(result.exception, InputError)
    assert re.match(message, str(result.exception))
    assert drawn("--figure", "old.pdf", "--force").exit_code == 0


@pytest.mark.parametrize("dpi", ["49", "601", "many"])
def test_dots_beyond_reason_are_refused(dpi: str) -> None:
    result = drawn("--figure", "a.png", "--dpi", dpi)
    assert result.exit_code == 2
    assert "--dpi" in result.output
