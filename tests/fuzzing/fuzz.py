"""Tries of a reader on damaged files."""

from __future__ import annotations

import faulthandler
import json
import re
import resource
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import hypothesis
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from albot_core.errors import InputError
from tests.fuzzing.damage import damaged
from tests.fuzzing.reader import Reader
from tests.fuzzing.readers import READERS


class Fuzz:
    """A reader and whole files of its kind.

    Args:
        reader: The reader.
        folder: Where the files may be written.
    """

    def __init__(self, reader: Reader, folder: Path) -> None:
        self.reader = reader
        self.folder = folder / "tried"
        """Where the files of the latest try are."""
        whole = folder / "whole"
        whole.mkdir()
        reader.write(whole)
        self.files = {path.name: path.read_bytes() for path in sorted(whole.iterdir())}
        """What the whole files hold, by their names."""

    def damaged(self, draw: Callable[[st.SearchStrategy[Any]], Any]) -> dict[str, bytes]:
        """One of the files, damaged."""
        name = draw(st.sampled_from(sorted(self.files)))
        return {name: draw(damaged(name, self.files[name]))}

    def attempt(self, changed: Mapping[str, bytes]) -> InputError | None:
        """Let the reader read the files, some of them changed; the error that it raises, if any.

        Anything else that it raises is a fault of the reader's.
        """
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir()
        for name, content in {**self.files, **changed}.items():
            (self.folder / name).write_bytes(content)
        try:
            self.reader.read(self.folder)
        except InputError as error:
            message = str(error)
            assert message.isprintable(), message
            assert len(message) < 2000, message[:2000]
            return error
        return None


@dataclass
class Tally:
    """What came of many tries."""

    read: int = 0
    """Inputs that were read."""
    refused: int = 0
    """Inputs that were refused in one clear error."""
    crashes: dict[str, int] = field(default_factory=dict)
    """How many inputs ended in something else, by what it was and where."""
    slowest: float = 0.0
    """The longest that any took (s of processor time)."""


def tally(reader: Reader, folder: Path, examples: int, seed: int) -> Tally:
    """Try a reader on so many damaged inputs; those that crash it are left in the folder."""
    fuzz, counts = Fuzz(reader, folder), Tally()
    assert fuzz.attempt({}) is None

    @settings(
        max_examples=examples,
        deadline=None,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @hypothesis.seed(seed)
    @given(data=st.data())
    def damage(data: Any) -> None:
        changed = fuzz.damaged(data.draw)
        faulthandler.dump_traceback_later(_HANGS, exit=True)
        began = time.process_time()
        try:
            refused = fuzz.attempt(changed) is not None
        except Exception as error:  # noqa: BLE001 - what it is is told
            where = traceback.extract_tb(error.__traceback__)
            ours = [each for each in where if "site-packages" not in each.filename][-1]
            name = f"{type(error).__name__} at {Path(ours.filename).name}:{ours.lineno}"
            if name not in counts.crashes:
                kept = folder / f"crash-{len(counts.crashes)}"
                shutil.copytree(fuzz.folder, kept)
                (kept / "traceback").write_text("".join(traceback.format_exception(error)))
            counts.crashes[name] = counts.crashes.get(name, 0) + 1
        else:
            counts.read += not refused
            counts.refused += refused
        faulthandler.cancel_dump_traceback_later()
        counts.slowest = max(counts.slowest, time.process_time() - began)

    damage()
    return counts


_HANGS = 120.0
"""After so long (s) a reader is taken to hang."""


MEMORY = 500_000_000
"""What a reader may take besides what its process had before (bytes)."""


def main(folder: str, examples: str, seed: str, *names: str) -> None:
    """Try readers in this process, and print what came of each as a line of JSON."""
    warnings.simplefilter("error")
    readers = {reader.name: reader for reader in READERS}
    for k, name in enumerate(names):
        found = re.search(r"VmData:\s+(\d+)", Path("/proc/self/status").read_text())
        assert found is not None
        _, most = resource.getrlimit(resource.RLIMIT_DATA)
        resource.setrlimit(resource.RLIMIT_DATA, (1024 * int(found[1]) + MEMORY, most))
        mine = Path(folder) / str(k)
        mine.mkdir(parents=True)
        counts = tally(readers[name], mine, int(examples), int(seed))
        print(json.dumps(asdict(counts)), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
