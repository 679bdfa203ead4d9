"""An episode that is interrupted at any line of its writer is whole when it is closed."""

from __future__ import annotations

import errno
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import mcap
import pytest
from mcap.writer import Writer

import albot_env.recording.writer
from albot_core.errors import InputError
from albot_env.recording.episode import EpisodeHeader, Moment
from albot_env.recording.reader import EpisodeReader
from albot_env.recording.writer import CHUNK_MOMENTS, EpisodeWriter

PLACES = 40
"""At so many lines, spread over all, an episode is interrupted."""


class _Lines:
    """Counts the lines that writers carry out, and raises a signal at one of them."""

    def __init__(self, stop: int = 0) -> None:
        self.count = 0
        self._stop = stop
        self._files = (albot_env.recording.writer.__file__, str(Path(mcap.__file__).parent))

    @contextmanager
    def watched(self) -> Iterator[None]:
        sys.settrace(self._enter)
        try:
            yield
        finally:
            sys.settrace(None)

    def _enter(self, frame: FrameType, event: str, argument: object) -> Any:
        return self._line if frame.f_code.co_filename.startswith(self._files) else None

    def _line(self, frame: FrameType, event: str, argument: object) -> Any:
        if event == "line":
            self.count += 1
            if self.count == self._stop:
                signal.raise_signal(signal.SIGINT)
        return self._line


@pytest.fixture
def recorded(episode: Path) -> tuple[EpisodeHeader, list[Moment]]:
    reader = EpisodeReader(episode)
    return reader.header, list(reader.moments())[: 2 * CHUNK_MOMENTS + 3]


@pytest.fixture(autouse=True)
def _ctrl_c() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt, whatever whoever started the tests wanted."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def _write(path: Path, header: EpisodeHeader, moments: list[Moment], lines: _Lines) -> int:
    """Write an episode, and close it as who is interrupted does; how many moments were added."""
    writer, added = EpisodeWriter(path), 0
    with lines.watched():
        try:
            writer.begin(header)
            for moment in moments:
                writer.add(moment)
                added += 1
        finally:
            try:
                writer.close()
            except KeyboardInterrupt:
                writer.close()
                raise
    return added


def test_an_interrupt_at_any_line_leaves_a_whole_episode(
    recorded: tuple[EpisodeHeader, list[Moment]], tmp_path: Path
) -> None:
    header, moments = recorded
    lines = _Lines()
    assert _write(tmp_path / "whole", header, moments, lines) == len(moments)
    lengths = set()
    for k in range(1, PLACES):
        path = tmp_path / f"{k}.mcap"
        with pytest.raises(KeyboardInterrupt):
            _write(path, header, moments, _Lines(lines.count * k // PLACES))
        reader = EpisodeReader(path)
        stamps = [moment.reading.stamp for moment in reader.moments()]
        assert not reader.torn
        assert stamps == [moment.reading.stamp for moment in moments[: len(stamps)]]
        lengths.add(len(stamps))
    assert lengths > {0, CHUNK_MOMENTS, 2 * CHUNK_MOMENTS}


def test_a_moment_that_was_added_outlives_an_interrupt(
    recorded: tuple[EpisodeHeader, list[Moment]], tmp_path: Path
) -> None:
    header, moments = recorded
    for count in (1, CHUNK_MOMENTS - 1, CHUNK_MOMENTS, CHUNK_MOMENTS + 1):
        path = tmp_path / f"{count}.mcap"
        writer = EpisodeWriter(path)
        writer.begin(header)
        for moment in moments[:count]:
            writer.add(moment)
        # As a process leaves it that is killed now, and as one that is interrupted does.
        reader = EpisodeReader(path)
        assert len(list(reader.moments())) == count - count % CHUNK_MOMENTS
        assert reader.torn
        writer.close()
        assert len(list(EpisodeReader(path).moments())) == count


def test_a_file_that_is_there_is_kept_if_asked_for(
    recorded: tuple[EpisodeHeader, list[Moment]], tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    path.write_text("mine")
    with pytest.raises(InputError, match=r"a\.mcap: expected a file that can be .*File exists"):
        EpisodeWriter(path, overwrite=False).begin(recorded[0])
    assert path.read_text() == "mine"
    writer = EpisodeWriter(tmp_path / "b.mcap", overwrite=False)
    writer.begin(recorded[0])
    writer.close()
    assert (tmp_path / "b.mcap").exists()


def test_a_file_that_holds_no_header_is_removed(
    recorded: tuple[EpisodeHeader, list[Moment]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Writer, "start", full)
    with pytest.raises(InputError, match="No space left on device"):
        EpisodeWriter(tmp_path / "a.mcap").begin(recorded[0])
    assert not (tmp_path / "a.mcap").exists()
