"""`albot export`: write episodes, maps and logs as files of other programs."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from albot_cli import completion
from albot_cli.bag_options import bag_options
from albot_cli.outputs import FORCE, JSON, check_file, check_folder, check_suffix, filled_folder
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.counts import many
from albot_core.errors import InputError

if TYPE_CHECKING:
    from albot_cli.export_source import Source
    from albot_core.logs.ros_bag import BagTopics

_PACKED = (".gz", ".xz")


@click.command()
@click.argument("files", metavar="FILE...", nargs=-1, required=True, type=PathType())
@click.option(
    "--to",
    "name",
    required=True,
    type=click.Choice(completion.EXPORTS),
    help="The format.",
)
@click.option(
    "--out",
    metavar="PATH",
    help="The file to write; with several FILEs the folder for theirs. For minari an id "
    "(`albot/homing-v0`) or a folder.  [default: FILE's name with the format's ending, here]",
)
@click.option(
    "--pose",
    type=click.Choice(completion.POSES),
    help="Which poses are written, or place the points of scans.  [default: the first of these "
    "that FILE has]",
)
@click.option("--keep-going", is_flag=True, help="Leave out the damaged lines of a log.")
@bag_options
@FORCE
@JSON
def command(
    files: tuple[Path, ...],
    name: str,
    out: str | None,
    pose: str | None,
    keep_going: bool,
    topics: BagTopics | None,
    force: bool,
    as_json: bool,
) -> None:
    """Write each FILE as a file of another program.

    FILE is an episode that `albot play` recorded (.mcap), a map that `albot map --out` saved
    (.albot), or a robot's log, which may be a ROS bag. Which formats each can become, and what is
    in them, is told by docs/exchange.md; an error names those that fit.

    Episodes become one Minari data set, for offline reinforcement learning. Their observations are
    made again, by their environment with the recorded actions, and all must be as recorded.
    """
    from albot_cli.export_formats import FORMATS, MINARI
    from albot_cli.export_source import read_source

    if out == "":
        raise InputError("--out", "a path", "nothing")
    takes_pose = [each for each, known in FORMATS.items() if known.takes_pose]
    if pose is not None and name not in takes_pose:
        expected = f"a format that takes it: {', '.join(takes_pose)}"
        raise InputError("--pose", expected, name)
    if name == MINARI:
        facts = _to_minari(files, out, force)
    else:
        target = None if out is None else Path(out)
        read = partial(read_source, keep_going=keep_going, topics=topics)
        facts = _to_files(files, name, target, read, pose, force)
    click.echo(json.dumps(facts) if as_json else _as_text(facts))


def _to_minari(files: tuple[Path, ...], out: str | None, force: bool) -> dict[str, Any]:
    """Write episodes as one data set; return its facts."""
    from albot_cli.export_source import is_episode, torn_note
    from albot_core.file_kinds import kind_of
    from albot_env.export.minari_dataset import DatasetPlace, check_place, new_minari_dataset
    from albot_env.export.replay import replay
    from albot_env.recording.reader import EpisodeReader

    if out is None:
        raise InputError("--out", "the id of the data set or its folder", "none")
    place = DatasetPlace.of(out)
    check_place(place, force=force)
    check_folder(place.folder)
    with (
        new_minari_dataset(place, force=force) as dataset,
        progress("export", len(files), "episodes") as update,
    ):
        for number, path in enumerate(files):
            if not is_episode(path):
                found = kind_of(path) or "another file"
                raise InputError(path, "a recorded episode, for minari", found)
            reader = EpisodeReader(path)
            dataset.add(replay(reader, path), path)
            _tell(path, torn_note(reader))
            update(number + 1)
    return {
        "format": "minari",
        **place.facts,
        "episodes": dataset.episodes,
        "steps": dataset.steps,
    }


def _to_files(
    files: tuple[Path, ...],
    name: str,
    out: Path | None,
    read: Callable[[Path], Source],
    pose: str | None,
    force: bool,
) -> dict[str, Any]:
    """Write each source as a file, all or none; return the facts."""
    from albot_cli.export_formats import FORMATS, check_fits

    known = FORMATS[name]
    if known.is_folder and len(files) > 1:
        raise InputError("FILE", f"one at a time, for {name}", str(len(files)))
    targets = _targets(files, out, known.suffix)
    if known.beside:
        check_suffix(targets[0], known.suffix, option="--out")
    known.check(targets[0])
    for path, target in zip(files, targets, strict=True):
        for each in (target, *(target.with_suffix(suffix) for suffix in known.beside)):
            if each.resolve() == path.resolve():
                raise InputError("--out", "a file other than FILE", str(each))
            if each.parent.exists() and not known.is_folder:
                check_file(each, force=force)
    facts = []
    alone = len(files) == 1 and not known.beside
    with nullcontext(Path()) if alone else filled_folder(targets[0].parent) as scratch:
        for path, target in zip(files, targets, strict=True):
            source = read(path)
            check_fits(source, name)
            known.write(source, pose, target if alone else scratch / target.name)
            for note in (source.unread, *source.notes):
                _tell(path, note)
            facts.append({"file": str(path), "kind": source.kind, "out": str(target)})
    return {"format": name, "files": facts}


def _targets(files: tuple[Path, ...], out: Path | None, suffix: str) -> list[Path]:
    """Return the file that each source is written to; all are in one folder."""
    if len(files) == 1 and out is not None:
        return [out]
    folder = Path() if out is None else out
    check_folder(folder)
    targets = [folder / f"{_stem(path)}{suffix}" for path in files]
    if len(set(targets)) < len(targets):
        twice = next(target for target in targets if targets.count(target) > 1)
        raise InputError("FILE", "files with names of their own", f"two for {twice}")
    return targets


def _stem(path: Path) -> str:
    path = path if path.name.strip(".") else path.resolve()
    return Path(path.stem).stem if path.suffix in _PACKED else path.stem


def _tell(path: Path, note: str) -> None:
    if note:
        click.echo(f"albot: {path}: {note}", err=True)


def _as_text(facts: dict[str, Any]) -> str:
    """Return the facts as text."""
    if "files" in facts:
        return "\n".join(f"{each['kind']:<8} {each['out']}" for each in facts["files"])
    size = f"{many(facts['episodes'], 'episode')}, {many(facts['steps'], 'step')}"
    return f"{facts['id']}: {size}\n  minari.load_dataset({facts['load']!r})"
