"""Kernels that kernels call are linked into these; and the line that says that it takes long."""

from __future__ import annotations

import gc
import logging
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba import float64
from numba.core.errors import TypingError, UnsupportedError

from albot_core.kernels import notice
from albot_core.kernels.compiled import kernel
from albot_core.kernels.notice import Notice


@kernel()
def _third(x: float) -> float:
    return x / 3.0


@kernel()
def _ninth(x: float) -> float:
    return _third(_third(x))


@kernel(arrays=True)
def _thirds(numbers: np.ndarray) -> np.ndarray:
    """An array of numba's own making, and a kernel that is called from both."""
    thirds = np.zeros(numbers.shape[0])
    for k in range(numbers.shape[0]):
        thirds[k] = _third(numbers[k]) + _ninth(numbers[k])
    return thirds


@kernel()
def _is_even(n: int) -> bool:
    return True if n == 0 else _is_odd(n - 1)


@kernel()
def _is_odd(n: int) -> bool:
    return False if n == 0 else _is_even(n - 1)


@kernel()
def _power(x: float, n: int) -> float:
    return x * _power(x, n - 1) if n > 0 else 1.0


@kernel()
def _apply(function: Any, x: float) -> float:
    total: float = function(x)
    return total


@kernel()
def _fail(x: float) -> float:
    if x < 0.0:
        raise ValueError("below zero")
    return x


@kernel()
def _pass_on(x: float) -> float:
    return _fail(x) + 1.0


@kernel()
def _ask_for_more(text: str) -> float:
    return _third(text)  # type: ignore[arg-type]


def test_a_kernel_holds_what_it_calls() -> None:
    np.testing.assert_array_equal(_thirds(np.array((9.0, 18.0))), (4.0, 8.0))
    assert (_third(9.0), _ninth(9.0)) == (3.0, 1.0)


def test_what_is_only_called_by_kernels_has_no_machine_code() -> None:
    @kernel()
    def called(x: float) -> float:
        return x + 1.0

    @kernel()
    def calling(x: float) -> float:
        return called(x)

    assert calling(1.0) == 2.0
    linked: Any = called
    assert not linked.overloads
    for compiled in linked.linked.overloads.values():
        assert not compiled.library.get_pointer_to_function(compiled.fndesc.llvm_func_name)
        assert "cpython" not in compiled.library.get_llvm_str()


def test_a_kernel_may_call_itself() -> None:
    assert _power(2.0, 10) == 1024.0
    assert _power(3.0, 2) == 9.0


def test_kernels_that_call_each_other_in_turns_are_refused() -> None:
    with pytest.raises(UnsupportedError, match=r"_is_odd.*by way of another"):
        _is_odd(2)
    with pytest.raises(UnsupportedError, match=r"_is_even.*by way of another"):
        _is_even(2)


def test_a_kernel_may_be_given_to_a_kernel() -> None:
    assert _apply(_third, 9.0) == 3.0
    assert _apply(_ninth, 9.0) == 1.0


def test_an_error_comes_out_of_the_kernel_that_python_called() -> None:
    assert _pass_on(1.0) == 2.0
    with pytest.raises(ValueError, match="below zero"):
        _pass_on(-1.0)


def test_types_that_a_called_kernel_cannot_take_are_told_at_each_call() -> None:
    for _ in range(2):
        with pytest.raises(TypingError):
            _ask_for_more("nine")


def test_threads_may_compile_the_same_at_once() -> None:
    @kernel(nogil=True)
    def inner(x: float) -> float:
        return _third(x) + 1.0

    @kernel(nogil=True)
    def outer(x: float) -> float:
        return inner(x) + 1.0

    found: list[float] = []
    calls = [lambda: found.append(outer(9.0)), lambda: found.append(inner(9.0))] * 3
    threads = [threading.Thread(target=call) for call in calls]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(found) == [4.0] * 3 + [5.0] * 3


def test_a_kernel_is_compiled_until_any_kernel_changes(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    @kernel()
    def fresh(x: float) -> float:
        return x

    compiled: Any = fresh
    kept = compiled._cache._cache_file
    monkeypatch.setattr(kept, "_cache_path", str(tmp_path))
    monkeypatch.setattr(kept, "_index_path", str(tmp_path / "index"))
    assert not compiled.is_compiled
    compiled(1.0)
    assert compiled.is_compiled
    compiled.overloads.clear()  # As in another process.
    assert compiled.is_compiled
    monkeypatch.setattr(kept, "_version", "of other kernels")
    assert not compiled.is_compiled


@pytest.mark.parametrize("enabled", [True, False])
def test_the_garbage_collector_waits_while_a_kernel_is_compiled(enabled: bool) -> None:
    was_enabled, within = gc.isenabled(), []

    @kernel()
    def fresh(x: float) -> float:
        return x

    compiler: Any = fresh
    compiler.linked.compile = lambda _: within.append(gc.isenabled()) or 1 / 0
    try:
        (gc.enable if enabled else gc.disable)()
        with pytest.raises(ZeroDivisionError):
            compiler._compiler._compile_core((float64,), None)
        assert gc.isenabled() is enabled
    finally:
        (gc.enable if was_enabled else gc.disable)()
    assert within == [False]


def test_without_compiling_kernels_are_functions() -> None:
    code = (
        "from albot_core.kernels.simd import padded_length; print(padded_length, padded_length(9))"
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    environment["PYTHONPATH"] = os.pathsep.join(sys.path)
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    assert done.stdout.startswith("<function padded_length")
    assert done.stdout.endswith("16\n")


CODE = """
import sys
import numpy as np
from albot_core.kernels.compiled import kernel
@kernel(arrays=True)
def inner(x):
    return np.full(2, x / 3.0)
@kernel(arrays=True)
def outer(x):
    return inner(x).sum()
@kernel()
def other(x):
    return x
if __name__ == "__main__":
    import called
    for name in sys.argv[1:]:
        kernel = getattr(called, name)
        print(name, kernel(9.0), *kernel.stats.cache_hits.values(), *kernel.linked.overloads)
"""


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., str]:
    """Calls kernels in a process of its own: what they return, whether kept, how linked."""
    (tmp_path / "called.py").write_text(CODE, encoding="utf-8")
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    environment["PYTHONPATH"] = os.pathsep.join((str(tmp_path), *sys.path))

    def call(*names: str) -> str:
        done = subprocess.run(
            [sys.executable, "called.py", *names],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.stdout or done.stderr

    return call


def test_kept_code_needs_nothing_of_what_it_calls(run: Callable[..., str], tmp_path: Path) -> None:
    assert run("outer") == "outer 6.0 (float64,)\n"
    assert run("outer") == "outer 6.0 1\n"
    kept = [path.name.split("-")[0] for path in (tmp_path / "kept").rglob("*.nbc")]
    assert kept == ["called.outer"]


def test_what_is_kept_goes_with_what_is_linked_anew(run: Callable[..., str]) -> None:
    """In both processes `inner` is the second that is compiled, and so of the same name."""
    assert run("other", "inner").splitlines()[1] == "inner [3. 3.] (float64,)"
    assert run("outer", "inner").splitlines() == [
        "outer 6.0 (float64,)",
        "inner [3. 3.] 1 (float64,)",
    ]


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds that the notice goes by."""
    now = [100.0]
    monkeypatch.setattr(notice.time, "monotonic", lambda: now[0])
    return now


def test_a_line_says_once_that_compiling_takes_long(
    clock: list[float], caplog: pytest.LogCaptureFixture
) -> None:
    given, notices = Notice(), []
    for _ in range(6):
        with given.compiling():
            clock[0] += 0.4
            given.give_if_due()
        notices.append(len(caplog.records))
        clock[0] += 10.0  # What is not spent compiling does not count.
    assert notices == [0, 0, 1, 1, 1, 1]
    record = caplog.records[0]
    assert (record.name, record.levelno) == ("albot_core.kernels", logging.WARNING)
    assert "compiling" in record.getMessage()


def test_worker_processes_say_nothing(
    clock: list[float], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notice, "parent_process", object)
    given = Notice()
    with given.compiling():
        clock[0] += 60.0
        given.give_if_due()
    assert not caplog.records
