"""Compiled code is kept as long as all that it was made from is the same, and no longer."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from albot_core.kernels import compiled, stamp
from albot_core.kernels.stamp import stamp_of

MARKED = "from albot_core.kernels.compiled import kernel\n"
CALLED = "@kernel()\ndef {name}(x):\n    return {result}\n"


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package with a kernel that has a kernel and a constant from two imports away."""
    folder = tmp_path / "mapper"
    (folder / "parts").mkdir(parents=True)
    files = {
        "__init__.py": "",
        "caller.py": MARKED
        + "from .parts import (\n    called,\n)\n"
        + CALLED.format(name="run", result="called.through(x)"),
        "parts/__init__.py": "",
        "parts/called.py": MARKED
        + "from mapper.parts.inner import inner\nimport mapper.constants as constants\n"
        + "ONE = constants.ONE\n"
        + CALLED.format(name="through", result="inner(x) + ONE"),
        "parts/inner.py": MARKED + CALLED.format(name="inner", result="2.0 * x"),
        "constants.py": "ONE = 1.0\n",
        "apart.py": MARKED + CALLED.format(name="apart", result="7.0 * x"),
    }
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder


def python(folder: Path, code: str) -> list[str]:
    """What a new process prints."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join((str(folder), *sys.path))}
    # Python would take the bytecode of a file that was as long, and written in the same second.
    environment["PYTHONDONTWRITEBYTECODE"] = "1"
    environment.pop("NUMBA_CACHE_DIR", None)
    command = [sys.executable, "-c", code]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return run.stdout.split()


def changed(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


def test_a_change_two_imports_away_is_seen_by_a_new_process(package: Path) -> None:
    code = (
        "from mapper import caller, apart\n"
        "print(caller.run(3.0), apart.apart(1.0))\n"
        "print(*(sum(one.stats.cache_hits.values()) for one in (caller.run, apart.apart)))"
    )
    folder = package.parent
    assert python(folder, code) == ["7.0", "7.0", "0", "0"]
    assert python(folder, code) == ["7.0", "7.0", "1", "1"]
    changed(package / "parts/inner.py", "2.0 * x", "5.0 * x")
    # Of the others nothing is compiled anew.
    assert python(folder, code) == ["16.0", "7.0", "0", "1"]
    changed(package / "constants.py", "1.0", "4.0")
    assert python(folder, code) == ["19.0", "7.0", "0", "1"]
    assert python(folder, code) == ["19.0", "7.0", "1", "1"]


def test_fields_that_change_places_are_seen_by_kernels_that_do_not_import_them(
    tmp_path: Path,
) -> None:
    body = "import numba\nfrom typing import NamedTuple\n"
    thing = body + "class Thing(NamedTuple):\n    x: float\n    y: float\n"
    (tmp_path / "things.py").write_text(thing, encoding="utf-8")
    doubled = MARKED + "@kernel()\ndef double(thing):\n    return 2.0 * thing.x\n"
    (tmp_path / "adding.py").write_text(doubled, encoding="utf-8")
    code = "import adding, things; print(adding.double(things.Thing(x=1.5, y=9.0)))"
    assert python(tmp_path, code) == ["3.0"]
    (tmp_path / "things.py").write_text(
        body + "class Thing(NamedTuple):\n    y: float\n    x: float\n", encoding="utf-8"
    )
    assert python(tmp_path, code) == ["3.0"]
    # What was kept names a type that is gone, with which it cannot be read.
    (tmp_path / "things.py").write_text(thing.replace("Thing", "Other"), encoding="utf-8")
    assert python(tmp_path, code.replace("Thing", "Other")) == ["3.0"]


def test_the_stamp_is_of_what_is_imported(package: Path) -> None:
    def stamps() -> tuple[str, str]:
        for kept in (stamp_of, stamp._imported, stamp._file_of, stamp._text, stamp._digest):
            kept.cache_clear()
        return tuple(
            stamp_of(f"mapper.{name}", package / f"{name}.py") for name in ("caller", "apart")
        )

    caller, apart = stamps()
    assert stamps() == (caller, apart)
    for path in ("parts/inner.py", "parts/__init__.py", "constants.py"):
        file = package / path
        before = file.read_text(encoding="utf-8")
        file.write_text(before + "TWO = 2\n", encoding="utf-8")
        assert stamps()[0] != caller, path
        assert stamps()[1] == apart, path
        file.write_text(before, encoding="utf-8")
    (package / "parts/inner.py").unlink()
    assert stamps()[0] != caller


def test_an_edit_compiles_little_anew() -> None:
    """Half of the files with kernels are in the stamps of no more than three of them."""
    root = Path(compiled.__file__).parents[2]
    files = [
        stamp.SourceFile(".".join(path.relative_to(root).with_suffix("").parts), path)
        for path in sorted((root / "albot_core").rglob("*.py"))
        if "kernels.compiled import" in path.read_text(encoding="utf-8")
    ]

    def closure(first: stamp.SourceFile) -> set[stamp.SourceFile]:
        reached, waiting = {first}, [first]
        while waiting:
            found = stamp._imported(waiting.pop()) - reached
            reached |= found
            waiting += found
        return reached

    closures = [closure(file) for file in files]
    touched = sorted(sum(file in of for of in closures) for file in files)
    assert len(files) > 50
    assert touched[len(touched) // 2] <= 3
