"""Tasks in processes of this machine: what those hear, and what becomes of those that die."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from albot_agents.engine.engine import RERUNS, Crash, OnStep
from albot_agents.engine.local import LocalEngine
from albot_core.errors import InputError
from albot_core.interrupts import INTERRUPTS
from tests.processes import running, wait_until


def blocked_signals(task: int, on_step: OnStep, /) -> list[str]:
    """Tells which signals do not reach the process."""
    return sorted(signal.Signals(n).name for n in signal.pthread_sigmask(signal.SIG_BLOCK, ()))


@pytest.mark.skipif(sys.platform == "win32", reason="signals cannot be blocked there")
def test_no_worker_hears_signals_not_even_the_first(tmp_path: Path) -> None:
    """In a process that has started no other one yet: with the first comes a tracker."""
    code = (
        "from albot_agents.engine.local import LocalEngine;"
        "from tests.agents.engine.test_local import blocked_signals;"
        "print([each.result for each in LocalEngine(1).run(blocked_signals, range(3))])"
    )
    with running([sys.executable, "-c", code], tmp_path) as process:
        out, errors = process.communicate(timeout=60)
    blocked = sorted(number.name for number in INTERRUPTS)
    assert (errors, out.decode().strip()) == (b"", str([blocked] * 3))


def test_signals_reach_us_again_once_workers_are_started() -> None:
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    list(LocalEngine(2).run(blocked_signals, range(2)))
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == before


def process_id(task: int, on_step: OnStep, /) -> int:
    return os.getpid()


@pytest.mark.parametrize(("fresh", "processes"), [(False, 1), (True, 3)])
def test_a_task_gets_a_process_of_its_own_where_that_is_asked(fresh: bool, processes: int) -> None:
    found = [each.result for each in LocalEngine(1).run(process_id, range(3), fresh=fresh)]
    assert (len(found), len(set(found))) == (3, processes)


def dying(folder: Path, deaths: int, task: int, on_step: OnStep, /) -> int:
    """The process dies in the third step of task 1, so many times; each try leaves a file."""
    on_step(2)
    if task == 1:
        tries = len(list(folder.iterdir()))
        (folder / str(tries)).touch()
        if tries < deaths:
            os.kill(os.getpid(), signal.SIGKILL)
    return -task


def test_a_task_whose_process_died_is_run_again(tmp_path: Path) -> None:
    done = list(LocalEngine(2).run(partial(dying, tmp_path, RERUNS), range(4)))
    assert {each.number: each.result for each in done} == {0: 0, 1: -1, 2: -2, 3: -3}
    assert len(list(tmp_path.iterdir())) == RERUNS + 1


def test_it_is_given_up_after_three_more_tries(tmp_path: Path) -> None:
    done = {each.number: each for each in LocalEngine(1).run(partial(dying, tmp_path, 9), range(3))}
    assert len(list(tmp_path.iterdir())) == RERUNS + 1
    cause = "the process died: signal SIGKILL"
    assert done[1].result == Crash(step=2, cause=cause, tries=RERUNS + 1)
    assert (done[0].result, done[2].result) == (0, -2)
    with pytest.raises(RuntimeError, match=f"^one, step 2: {cause}, 4 times$"):
        done[1].required("one")


def raising(kind: Callable[[], Exception], task: int, on_step: OnStep, /) -> int:
    on_step(7)
    if task == 1:
        raise kind()
    return task


def bad_input() -> Exception:
    return InputError("a.yml", "a mapping", "a list", place="line 3")


def full_disk() -> Exception:
    return OSError(errno.ENOSPC, "No space left on device", "a.png")


@pytest.mark.parametrize("kind", [bad_input, full_disk])
def test_bad_input_and_a_full_disk_end_the_run(kind: Callable[[], Exception]) -> None:
    with pytest.raises(type(kind()), match=str(kind()).replace("[", r"\[").replace("]", r"\]")):
        list(LocalEngine(1).run(partial(raising, kind), range(3)))


def test_a_bug_is_not_tried_again_and_tells_its_place() -> None:
    done = list(LocalEngine(1).run(partial(raising, KeyError), range(3)))
    assert [each.result for each in done if each.number != 1] == [0, 2]
    crash = done[1].result
    assert isinstance(crash, Crash)
    assert (crash.step, crash.tries) == (7, 1)
    assert crash.cause.startswith("KeyError:  (test_local.py:")
    assert "raise kind()" in crash.details
    with pytest.raises(RuntimeError, match=r"(?s)^one, step 7: KeyError.*Traceback"):
        done[1].required("one")


def leaving_files(task: int, on_step: OnStep, /) -> str:
    """Makes a temporary folder, and never comes to remove it."""
    folder = tempfile.mkdtemp()
    if task:
        signal.pause()
    return folder


def test_nothing_is_left_of_a_process_that_is_ended(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    results = LocalEngine(2).run(leaving_files, range(2))
    left = Path(next(results).required("one"))
    assert left.is_dir()
    assert left.is_relative_to(tmp_path)
    results.close()
    assert not list(tmp_path.iterdir())


def test_workers_tidy_up_after_one_that_was_killed(tmp_path: Path) -> None:
    program = (
        "from albot_agents.engine.local import LocalEngine\n"
        "from tests.agents.engine.test_local import leaving_files\n"
        "if __name__ == '__main__':\n"
        "    results = LocalEngine(2).run(leaving_files, range(2))\n"
        "    print(next(results).result, flush=True)\n"
        "    input()\n"
    )
    (tmp_path / "program.py").write_text(program)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    paths = os.pathsep.join(path for path in sys.path if path)
    process = subprocess.Popen(
        [sys.executable, tmp_path / "program.py"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(scratch), "PYTHONPATH": paths},
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith(str(scratch).encode())
        assert list(scratch.iterdir())
    finally:
        process.kill()
        process.communicate()
    wait_until(lambda: not list(scratch.iterdir()))


def test_closing_ends_all_processes_and_takes_no_more_tasks() -> None:
    taken: list[int] = []

    def tasks():
        for number in range(100):
            taken.append(number)
            yield number

    results = LocalEngine(2).run(process_id, tasks())
    process = next(results).result
    results.close()
    assert isinstance(process, int)
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    assert len(taken) <= 3
