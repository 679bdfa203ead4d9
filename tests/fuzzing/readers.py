"""All that reads files: one entry for each reader, with whole files of its kind.

`test_readers.py` damages the files and lets each reader have a go; a function that reads a file and
stands in no entry fails a test there. A new reader is an entry here.
"""

from __future__ import annotations

import gzip
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from albot_agents.benchmark.cell import Cell
from albot_agents.benchmark.costs import read_costs
from albot_agents.benchmark.entrant import find_entrant
from albot_agents.benchmark.folder import AgentRecord, ResultsFolder
from albot_agents.benchmark.page import Report, render_page
from albot_agents.benchmark.protocol import find_protocol
from albot_agents.benchmark.rows_file import Results, read_results, write_rows
from albot_agents.benchmark.times import read_times
from albot_agents.engine.rows import TAIL, Manifest, RowsFolder, parts, read_rows
from albot_agents.registry import find_agent
from albot_agents.task import config_kind
from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.card import read_evaluation, write_card
from albot_agents.trained.network import Network
from albot_agents.trained.trained_agent import shipped_agents
from albot_agents.training.checkpoint import read_checkpoint
from albot_agents.training.demonstrations import read_demonstrations
from albot_agents.training.learning_curve import read_curves
from albot_agents.training.plan_file import read_plan, save_plan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from albot_agents.training.seed_folder import SeedFolder
from albot_cli.config import read_task_config
from albot_cli.worlds import in_full, summary
from albot_core.archive import read_arrays
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import (
    Trajectory,
    read_relations,
    relation_error,
    trajectory_error,
)
from albot_core.files import read_beginning, read_bytes, read_text
from albot_core.json_document import read_json
from albot_core.logs.reader import read_log, read_reference
from albot_core.logs.ros_bag import read_ros_bag
from albot_core.logs.wean import read_wean_map
from albot_core.mappers.registry import make_mapper
from albot_core.plain_data import to_plain
from albot_core.yaml_document import read_yaml
from albot_maps import World, load_world
from albot_maps.formats.house_json import read_house_json
from albot_maps.formats.picture import read_shades
from albot_maps.formats.plan_xml import read_plan_xml
from albot_maps.formats.ros_grid import read_ros_grid
from albot_maps.formats.stage_world import read_stage_world
from albot_maps.formats.world_file import world_text
from albot_maps.load import load_worlds, read_world
from albot_stress.episodes import Episode
from albot_stress.rows import COLUMNS, outcome_of
from tests.agents.benchmark.episodes import results as made_up
from tests.agents.training.demonstrated import ACTIONS, LESSON, demonstrations
from tests.agents.training.tiny import TASK, TINY, begun, plan_file
from tests.core.logs.conftest import WRITERS, make_drive
from tests.core.ros.drives import Drive, write_ros1, write_ros2
from tests.fuzzing.episodes_and_maps import episode_readers, mapper_readers
from tests.fuzzing.reader import Reader, one_file
from tests.maps.formats import test_house_json, test_plan_xml, test_ros_grid, test_stage_world

# Logs, and what they are scored by.


def _read_log(path: Path) -> None:
    try:
        log = read_log(path)
    except InputError:
        log = read_log(path, keep_going=True)
    mapper = make_mapper("albot1")
    for reading in log.readings:
        mapper.update(reading)
    assert np.isfinite(mapper.estimate.pose).all()
    assert log.path_length >= 0


def _read_reference(path: Path) -> None:
    truth = read_reference(path)
    trajectory_error(truth, truth)


def _read_relations(path: Path) -> None:
    relation_error(Trajectory(stamps=np.arange(3.0), poses=np.eye(3)), read_relations(path))


_DRIVE = Drive(chain=("base_link", "plate", "laser"), turned=(0.3, 0.0, np.pi), scans=3, poses=20)


def _write_ros2(folder: Path, storage: str, compression: str) -> None:
    """Write a bag whose file has no ending, so that it is damaged byte by byte."""
    bag = write_ros2(_DRIVE.messages(), folder / "bag", storage, compression)
    (file,) = (path for path in bag.iterdir() if path.suffix != ".yaml")
    text = (bag / "metadata.yaml").read_text().replace(file.name, "messages")
    (folder / "metadata.yaml").write_text(text)
    file.rename(folder / "messages")
    shutil.rmtree(bag)


def _log_readers() -> Iterator[Reader]:
    for kind, writer in WRITERS.items():
        text = writer(make_drive(kind, scans=3))
        name = "run.json" if kind == "json" else "run.log"
        yield one_file(f"log, {kind}", name, text, _read_log, read_log)
    line = " ".join(("3000000 1 10 20", "0 " * 21, "1500 " * 682))
    yield one_file("log, BreezySLAM", "exp.dat", f"{line}\n{line}\n", _read_log, read_log)
    packed = gzip.compress(WRITERS["carmen"](make_drive("carmen", scans=3)).encode(), mtime=0)
    yield one_file("log, packed", "run.log.gz", packed, _read_log, read_beginning)
    for kind in ("corrected", "json"):
        text = WRITERS[kind](make_drive(kind, scans=3))
        yield one_file(f"reference, {kind}", "a.log", text, _read_reference, read_reference)
    tum = "# stamp x y z qx qy qz qw\n0 1 2 0 0 0 0 1\n1 1.5 2 0 0 0 0.6 0.8\n2.5 1 3 0 0 0 1 0\n"
    yield one_file("reference, TUM", "a.tum", tum, _read_reference, read_reference)
    relations = "# t1 t2 x y z roll pitch yaw\n0 1 0.5 0 0 0 0 0.1\n1 2 0.4 0.1 0 0 0 -0.2\n"
    yield one_file("relations", "a.relations", relations, _read_relations, read_relations)
    grid = "robot_specifications->resolution 10\n\nglobal_map[0]: 3 3\n1 1 1\n0 0.1 0\n-1 -1 0.7\n"
    yield one_file("Wean Hall's map", "map.dat", grid, read_wean_map, read_wean_map)
    for compression in ("", "lz4", "bz2"):
        yield Reader(
            name=f"ROS 1 bag {compression}".strip(),
            functions=(read_ros_bag,),
            write=lambda folder, packed=compression: write_ros1(
                _DRIVE.messages(), folder / "a.bag", packed
            ),
            read=lambda folder: _read_log(folder / "a.bag"),
        )
    for storage, compression in (("mcap", ""), ("mcap", "storage"), ("sqlite3", "message")):
        yield Reader(
            name=f"ROS 2 bag {storage} {compression}".strip(),
            functions=(read_ros_bag,),
            write=partial(_write_ros2, storage=storage, compression=compression),
            read=_read_log,
        )


# Worlds.


def _read_world(path: Path) -> None:
    _look_at(read_world(path))


def _look_at(world: World) -> None:
    in_full(summary(world))
    world_text(world)


def _read_spec(path: Path) -> None:
    _look_at(load_worlds(path.read_bytes().decode("utf-8", "surrogateescape"))[0])


FURNISHED = """albot-world: 1
name: furnished
notes: [drawn by hand]
walls: [[[0, 0], [8, 0], [8, 6], [0, 6], [0, 0]], [[4, 0], [4, 2.5]], [[4, 3.5], [4, 6]]]
glass: [[[1, 5], [2, 5]]]
boxes: [[6, 4, 7, 5]]
polygons: [[[6, 1], [7, 1], [6.5, 1.5]]]
rooms: {west: [[0, 0], [4, 0], [4, 6], [0, 6]], east: [[4, 0], [8, 0], [8, 6], [4, 6]]}
exits: {D1: {line: [[4, 2.5], [4, 3.5]], rooms: [west, east]}}
starts: [{at: [1, 3], heading: 90}, {at: [5, 3], heading_rad: 0.5}]
tours: {round: [[1, 3], [5, 3], [1, 3]]}
movables:
  doors: [{hinge: [4, 2.5], heading: 90, width: 0.9, opening: 80, open_for: [5, 9]}]
  boxes: [{at: [2, 1.5], heading: 10, length: 0.4, mass: 3}]
  walkers: [{route: [[1, 4], [3, 4]], speed: [0.5, 1]}]
"""
"""A world that holds a little of everything."""


def _write_ros_map(folder: Path, name: str) -> None:
    test_ros_grid.write_map(folder, test_ros_grid.room(), image=name)
    (folder / "map.pgm").unlink()
    Image.fromarray(test_ros_grid.room()).save(folder / name)


def _write_stage_world(folder: Path) -> None:
    pixels = np.full((60, 100), 255, np.uint8)
    pixels[10:50, 10:90] = 0
    pixels[12:48, 12:88] = 200
    Image.fromarray(pixels).save(folder / "room.png")
    (folder / "map.inc").write_text(test_stage_world.MAP_INC)
    (folder / "a.world").write_text(test_stage_world.WORLD.replace("bitmaps/", ""))


def _plan() -> str:
    drawn = test_plan_xml
    rooms = [
        drawn.space(k, k.upper(), at, drawn.DOOR)
        for k, at in (("a", drawn.LEFT), ("b", drawn.RIGHT))
    ]
    return drawn.plan(*rooms)


def _world_readers() -> Iterator[Reader]:
    ours = (read_world, read_yaml, read_bytes, read_text)
    yield one_file("world, YAML", "a.yaml", FURNISHED, _read_world, *ours)
    yield one_file("world, XML", "a.xml", _plan(), _read_world, read_plan_xml)
    house = json.dumps(test_house_json.HOUSE)
    yield one_file("world, HouseExpo", "a.json", house, _read_world, read_house_json, read_json)
    for suffix in ("pgm", "png"):
        yield Reader(
            name=f"world, ROS {suffix}",
            functions=(read_ros_grid, read_shades),
            write=partial(_write_ros_map, name=f"map.{suffix}"),
            read=lambda folder: _read_world(folder / "map.yaml"),
        )
    yield Reader(
        name="world, Stage",
        functions=(read_stage_world,),
        write=_write_stage_world,
        read=lambda folder: _read_world(folder / "a.world"),
    )
    for spec in ("random:office:1..3?rooms=4&people=1&clutter=0.5", "random:maze:7", "square-loop"):
        yield one_file(f"spec {spec}", "spec.txt", spec, _read_spec, load_world, load_worlds)


# Agents.


def _act(path: Path) -> None:
    file = find_agent(str(path)).file
    assert file is not None
    network = Network(file.network, file.weights)
    for _ in range(2):
        answer = network(np.full(file.network.inputs, -1, np.float32))
        if file.network.sampled:
            answer = network.sample(answer, np.random.default_rng(0))
        assert np.isfinite(answer).all()


def _agent_readers() -> Iterator[Reader]:
    for name, path in shipped_agents().items():
        if name in ("homing-blind", "exploring", "place-recognition"):
            yield one_file(f"agent, {name}", "a.albot", path.read_bytes(), _act, read_agent)


def _write_evaluation(folder: Path) -> None:
    path = shipped_agents()["place-recognition"]
    figures = {
        "task": "Albot/PlaceRecognition-v0", "world_specs": ["random:office"], "seeds": "1..9",
        "episodes": 9, "odometer": "poor", "mapper": "odometry", "success_rate": 0.96,
        "ci95": [0.9, 0.99], "spl": None, "precision": 0.9, "recall": 0.9, "agent": "random",
        "fingerprint": read_agent(path).fingerprint,
    }  # fmt: skip
    (folder / "evaluation.json").write_text(json.dumps(figures))


def _write_card(folder: Path) -> None:
    agent = read_agent(shipped_agents()["place-recognition"])
    agent = replace(agent, training=replace(agent.training, curve={}))
    figures = read_evaluation(folder / "evaluation.json", agent)
    write_card(agent, "a", folder / "card.md", [figures])


_FACTS = {
    "task": "Albot/Homing-v0", "fingerprint": "ab", "samples": 9, "asked": 8, "algorithm": "ppo",
    "seed": 1, "command": "albot train", "seconds": 2.5, "mapper": "none",
}  # fmt: skip
_CELL = Cell(task="Albot/Homing-v0", agent="a", mapper="none", odometer="poor", worlds="offices")


def _write_results(folder: Path) -> None:
    results = ResultsFolder(folder)
    results.begin()
    episodes = made_up(_CELL, 2)
    shipped = find_entrant("homing")
    results.write(episodes)
    results.write_agent(shipped)
    results.file(_CELL).rename(folder / "cell.jsonl")
    (folder / "agents" / "homing.json").rename(folder / "agent.json")
    shutil.rmtree(folder / "agents")
    shutil.rmtree(folder / "cells")


def _read_results(folder: Path) -> None:
    results = folder / "results"
    shutil.rmtree(results, ignore_errors=True)
    results.mkdir()
    shutil.copy(folder / "benchmark.json", results)
    cell = ResultsFolder(results).file(_CELL)
    cell.parent.mkdir(parents=True)
    shutil.copy(folder / "cell.jsonl", cell)
    (results / "agents").mkdir()
    shutil.copy(folder / "agent.json", results / "agents" / "a.json")
    render_page(Report.of(ResultsFolder(results)))


def _write_rows_of_results(folder: Path) -> None:
    found = made_up(_CELL, 2)
    record = AgentRecord(facts=_FACTS, plan="task: homing")
    results = Results(
        source=folder, cells={_CELL: found}, agents={"a": record}, costs={"albot1": 2.5}
    )
    write_rows(results, find_protocol(), folder / "rows.jsonl.gz")
    packed = folder / "rows.jsonl.gz"
    (folder / "rows.jsonl").write_bytes(gzip.decompress(packed.read_bytes()))


def _read_rows_of_results(folder: Path) -> None:
    out = ResultsFolder(folder / "results")
    shutil.rmtree(out.path, ignore_errors=True)
    for name in ("rows.jsonl.gz", "rows.jsonl"):
        read_results(folder / name, out.protocol).write(out)
    render_page(Report.of(out))


# Trainings.


def _write_run(folder: Path) -> None:
    run, plan = begun(folder)
    TrainingRun(run, plan).run()
    shutil.rmtree(run.tensorboard)
    for path in run.path.rglob("*"):
        if path.is_file():
            path.rename(folder / path.name)
    shutil.rmtree(run.path)
    (folder / "plan.yml").unlink()


def _resume(folder: Path) -> None:
    run = RunFolder(folder)
    run.checkpoints.mkdir(exist_ok=True)
    for path in folder.glob("*.checkpoint"):
        shutil.copy(path, run.checkpoints)
    assert isinstance(run.command, str)
    training = TrainingRun(run, run.resume(None))
    training.close()


def _write_curve(folder: Path) -> None:
    path = shipped_agents()["place-recognition"]
    run = RunFolder(folder)
    run.last.write_bytes(path.read_bytes())
    save_plan(read_agent(path).training.plan, run.plan)
    run.monitor.touch()


def _draw_curve(folder: Path) -> None:
    curves = read_curves([folder])
    assert curves.csv
    assert curves.facts
    curves.figure()


def _write_seeds(folder: Path) -> None:
    seeds = SeedFolder(folder)
    seeds.begin(read_plan(plan_file(folder / "plan.yml"), tried=False), (1, 2), "albot train")
    shutil.rmtree(seeds.run(1).path)
    shutil.rmtree(seeds.run(2).path)
    (folder / "plan.yml").unlink()


def _read_demonstrations(path: Path) -> None:
    made = read_demonstrations(path, LESSON, 3)
    (said,) = made.first(1).said(ACTIONS).values()
    assert said.shape == made.returns(0.9)[1].shape


def _write_rows(folder: Path) -> None:
    """Write rows as they are while a run goes on."""
    _write_parts(folder)
    rows = list(read_rows(folder, COLUMNS))
    for part in parts(folder):
        part.unlink()
    (folder / TAIL).write_text("".join(json.dumps(row) + "\n" for row in rows))


def _write_parts(folder: Path) -> None:
    """Write rows as they are at the end."""
    row = dict.fromkeys(COLUMNS) | {"world": "office", "seed": 3, "steps": 9}
    row |= {"agent": "random", "mapper": "none"}
    with _rows_folder(folder).opened(resume=False):
        pass
    rows = _rows_folder(folder)
    with rows.opened(resume=True):
        for number in range(3):
            rows.add(number, row | {"violations": [[number, "walls", "is in a wall"]]})


def _rows_folder(folder: Path) -> RowsFolder:
    manifest = Manifest(command="stress", words=["--seed", "1"], plan={"seed": 1}, tasks=3)
    return RowsFolder(path=folder, manifest=manifest, columns=COLUMNS)


def _read_rows(folder: Path) -> None:
    """Go on with the run."""
    Manifest.read(folder, "stress")
    with _rows_folder(folder).opened(resume=True) as known:
        for row in known.values():
            episode = Episode(
                world="office", agent="", mapper="", seed=3, steps=9, odometer=None, faults=None
            )
            episode = replace(episode, **{n: row[n] for n in ("agent", "mapper")})
            assert outcome_of(row, episode, folder).steps == row["steps"]


READERS: tuple[Reader, ...] = (
    *_log_readers(),
    *_world_readers(),
    *episode_readers(),
    *mapper_readers(),
    *_agent_readers(),
    Reader(
        name="evaluation",
        functions=(read_evaluation,),
        write=_write_evaluation,
        read=_write_card,
    ),
    one_file(
        "costs",
        "costs.json",
        '{"costs": {"albot1": 1.5, "odometry": 1.0}}',
        lambda path: read_costs(path.parent),
        read_costs,
    ),
    Reader(
        name="results",
        functions=(ResultsFolder,),
        write=_write_results,
        read=_read_results,
    ),
    *(
        Reader(
            name=f"rows, {name}",
            functions=(Manifest.read, read_rows),
            write=write,
            read=_read_rows,
        )
        for name, write in (("lines", _write_rows), ("Parquet", _write_parts))
    ),
    Reader(
        name="rows of results",
        functions=(read_results,),
        write=_write_rows_of_results,
        read=_read_rows_of_results,
    ),
    one_file(
        "times of results",
        "times.json",
        '{"cells": {"homing-v0/offices/poor/a@none": {"episodes": 2, "seconds": 1.5}}}',
        lambda path: read_times(path.parent),
        read_times,
    ),
    Reader(
        name="demonstrations",
        functions=(read_demonstrations,),
        write=lambda folder: demonstrations(rewards=np.ones((2, 3), np.float32)).save(
            folder / "a.npz"
        ),
        read=lambda folder: _read_demonstrations(folder / "a.npz"),
    ),
    one_file(
        "training plan", "a.yml", yaml.safe_dump(TINY), lambda path: read_plan(path), read_plan
    ),
    one_file(
        "configuration of a task",
        "a.yml",
        yaml.safe_dump(to_plain(config_kind(TASK)()), sort_keys=False),
        partial(read_task_config, TASK),
        read_task_config,
    ),
    Reader(
        name="run folder",
        functions=(read_checkpoint, read_arrays, RunFolder),
        write=_write_run,
        read=_resume,
        examples=12,
    ),
    Reader(
        name="learning curve",
        functions=(read_curves,),
        write=_write_curve,
        read=_draw_curve,
    ),
    Reader(
        name="folder of several seeds",
        functions=(SeedFolder,),
        write=_write_seeds,
        read=lambda folder: SeedFolder(folder).resume(None),
        examples=12,
    ),
)
"""All readers."""
