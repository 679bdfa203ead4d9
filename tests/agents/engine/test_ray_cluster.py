"""Tasks on a real Ray cluster of two nodes on this machine, and what is not one."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import time
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import albot_env
from albot_agents.engine import ray_cluster
from albot_agents.engine.choice import make_engine
from albot_agents.engine.engine import RERUNS, Crash, OnStep
from albot_agents.engine.local import LocalEngine
from albot_agents.engine.ray_cluster import RayEngine
from albot_core.errors import InputError
from tests.agents.engine.test_local import bad_input, dying, process_id, raising
from tests.processes import ALBOT, family, is_gone, listening, running, wait_until

pytestmark = pytest.mark.skipif(
    find_spec("ray") is None, reason="Ray is not installed: pip install '.[cluster]'"
)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    """A head and another node, one processor each, on the loopback interface."""
    from ray.cluster_utils import Cluster

    store = {"num_cpus": 1, "object_store_memory": 100 << 20, "include_dashboard": False}
    made = Cluster(initialize_head=True, head_node_args=store)
    made.second = made.add_node(num_cpus=1, object_store_memory=100 << 20)
    yield made
    made.shutdown()


@pytest.fixture(scope="module")
def engine(cluster: Any) -> Iterator[RayEngine]:
    with RayEngine(cluster.address) as made:
        made.start()
        yield made


def numbers(seen: Path, task: int, on_step: OnStep, /) -> tuple[np.ndarray, int]:
    """Some work; and the process that started the worker, of which each node has one.

    Args:
        seen: A folder; no task ends before two nodes have left their mark in it, however slowly
            the second starts its worker.
        task: Seed of the numbers.
        on_step: Not called.
    """
    (seen / str(os.getppid())).touch()
    wait_until(lambda: len(list(seen.iterdir())) > 1, 240)
    time.sleep(0.05)  # The node that dies is in the middle of one.
    return np.random.default_rng(task).normal(size=1000).cumsum(), os.getppid()


def test_a_dead_workers_task_is_run_again_and_at_last_listed(
    engine: RayEngine, tmp_path: Path
) -> None:
    done = {each.number: each.result for each in engine.run(partial(dying, tmp_path, 9), range(3))}
    assert len(list(tmp_path.iterdir())) == RERUNS + 1
    cause = "the process died: it crashed or was killed"
    assert isinstance(done[1], Crash)
    assert (done[1].step, done[1].cause, done[1].tries) == (None, cause, RERUNS + 1)
    assert (done[0], done[2]) == (0, -2)


def test_bad_input_ends_the_run_and_a_bug_does_not(engine: RayEngine) -> None:
    with pytest.raises(InputError, match="line 3: expected a mapping"):
        list(engine.run(partial(raising, bad_input), range(3)))
    done = {each.number: each.result for each in engine.run(partial(raising, KeyError), range(3))}
    assert (done[0], done[2]) == (0, 2)
    assert isinstance(done[1], Crash)
    assert (done[1].step, done[1].tries) == (7, 1)


def test_nodes_have_the_same_version(engine: RayEngine, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(albot_env, "__version__", "0.0.1")
    with pytest.raises(InputError, match=r"expected albot-env 0\.0\.1 on all nodes, .* found "):
        list(engine.run(process_id, range(2)))


def test_relative_paths_and_variables_are_those_of_the_command(
    engine: RayEngine, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    (found,) = (each.result for each in engine.run(surroundings, [0]))
    assert found == (str(tmp_path), os.environ.get("ALBOT_DATA"))


def surroundings(task: int, on_step: OnStep, /) -> tuple[str, str | None]:
    return str(Path.cwd()), os.environ.get("ALBOT_DATA")


def test_a_node_that_dies_in_the_middle_costs_nothing(
    engine: RayEngine, cluster: Any, tmp_path: Path
) -> None:
    """The results are those of processes of this machine, to the last bit."""
    tasks, nodes, found = range(60), set(), {}
    work = partial(numbers, tmp_path)
    for done in engine.run(work, tasks):
        assert not isinstance(done.result, Crash)
        found[done.number], node = done.result
        nodes.add(node)
        if len(nodes) == 2 and cluster.second is not None:
            cluster.remove_node(cluster.second, allow_graceful=False)
            cluster.second = None
    assert cluster.second is None
    assert found.keys() == set(tasks)
    for done in LocalEngine(1).run(work, tasks):
        assert not isinstance(done.result, Crash)
        assert found[done.number].tobytes() == done.result[0].tobytes()


@pytest.mark.parametrize(
    ("address", "found"),
    [
        ("nowhere", "expected HOST:PORT of the head of a Ray cluster, or auto, found nowhere"),
        ("ray://head:10001", "expected HOST:PORT"),
        ("head:99999", "expected HOST:PORT"),
        ("127.0.0.1:1", "found nothing that answers at 127.0.0.1:1: Connection refused"),
        ("no-such-host.invalid:6379", "found nothing that answers"),
    ],
)
def test_what_is_no_cluster_is_refused_in_seconds(address: str, found: str) -> None:
    began = time.monotonic()
    with pytest.raises(InputError, match=re.escape(found)):
        RayEngine(address).start()
    assert time.monotonic() - began < 10


def test_another_program_is_no_cluster(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_cluster, "PATIENCE", (5.0, 1.0))
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(InputError, match="found something that does not answer as one"):
            RayEngine(address).start()


def test_options_that_do_not_go_together() -> None:
    with pytest.raises(InputError, match="--address: expected --engine ray"):
        make_engine("local", address="auto")
    with pytest.raises(InputError, match=r"local or ray, found rai \(did you mean ray"):
        make_engine("rai")


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"--engine ray: expected the package of .*\[cluster\]"):
        make_engine("ray")


STRESS = ("stress", "--worlds", "square-loop", "--steps", "20", "--agent", "random", "--json",
          "--jobs", "2")  # fmt: skip


def test_a_cluster_of_its_own_is_closed_to_others_and_ends_with_the_command(tmp_path: Path) -> None:
    """Until Ctrl-C it listens on the loopback interface alone, and asks for a token."""
    words = [*ALBOT, *STRESS, "--count", "100000", "--engine", "ray"]
    token = Path.home() / ".ray" / "auth_token"
    before = token.exists()
    with running(words, tmp_path) as process:
        wait_until(lambda: _workers(process.pid) > 0, 240)
        addresses, variables = listening(process.pid), _environments(process.pid)
        os.killpg(process.pid, signal.SIGINT)
        # Two or three seconds where the machine is not busy.
        out, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, b"")
    assert json.loads(out)["stopped"] is True
    assert addresses
    assert {address.rpartition(":")[0] for address in addresses} == {"127.0.0.1"}
    assert len(variables) >= 2
    for wanted in ("RAY_AUTH_TOKEN=", "RAY_AUTH_MODE=token", "RAY_USAGE_STATS_ENABLED=0"):
        assert all(wanted in each for each in variables)
    assert is_gone(process.pid)
    assert not list(tmp_path.iterdir())
    assert token.exists() is before


def _workers(pid: int) -> int:
    """How many of them run a task."""
    names = (folder / "cmdline" for folder in family(pid).values())
    return sum(b"_run_remote" in name.read_bytes() for name in names if name.exists())


def _environments(pid: int) -> list[str]:
    """The environments of Ray's servers; its Python processes write a title over theirs."""
    folders = family(pid).values()
    rays = [each for each in folders if b"/ray/core/src/ray/" in (each / "cmdline").read_bytes()]
    return [(each / "environ").read_text() for each in rays]
