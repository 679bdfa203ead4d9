"""`albot bench`: measure speed; each figure beside a baseline run in the same minute."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from albot_cli.long_run_page import journey_figure, write_long_run
from albot_cli.number_types import CountType
from albot_cli.outputs import FORCE, JSON, FigureFile, check_file, check_suffix, figure_options
from albot_cli.path_type import PathType
from albot_cli.peers_page import range_accuracy, write_peers
from albot_cli.progress import progress
from albot_core.errors import InputError
from albot_core.logs.reader import read_log
from albot_core.mappers.registry import installed_mappers

ROUNDS = 6
"""Rounds in which each environment is timed."""
PARTS = (
    "laser",
    "mapper",
    "views",
    "journey",
    "env",
    "processes",
    "learner",
    "generator",
    "painting",
    "startup",
    "ratslam",
    "slam",
    "peers",
)
PAGES = {"journey": write_long_run, "peers": write_peers}
"""The parts that have a page, and the functions that write it."""


@click.command()
@click.option("--part", "parts", multiple=True, help=f"Measure only this part: {', '.join(PARTS)}.")
@click.option(
    "--log",
    type=PathType(),
    help="A real robot's log for the mappers; by default they map a simulated tour.",
)
@click.option(
    "--out",
    type=PathType(),
    help="Page for the journey or the peers, in Markdown; a picture is written beside it.",
)
@click.option(
    "--rounds",
    type=CountType(1),
    help="Number of times each environment is measured; the best counts. More rounds help on a "
    f"busy machine.  [default: {ROUNDS}]",
)
@figure_options("the journey")
@FORCE
@JSON
def command(
    parts: tuple[str, ...],
    log: Path | None,
    out: Path | None,
    rounds: int | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> None:
    """Measure speed: laser, mappers, environments, pictures, a learner, worlds, other simulators.

    The part `views` compares distances between the views that `albot1` takes in. The part `journey`
    leads a mapper 10 km through a building, to see whether it slows down.
    Each other figure is the best of several rounds on one core; `processes` uses a core for each
    process, `learner` all cores.
    """
    for part in parts:
        if part not in PARTS:
            raise InputError("--part", f"one of {', '.join(PARTS)}", repr(part))
    if log is not None and parts and not {"mapper", "slam"} & set(parts):
        expected = "--part mapper or slam, whose mappers map it"
        raise InputError("--log", expected, ", ".join(parts))
    paged = [part for part in PAGES if part in parts]
    if out is not None:
        if len(paged) != 1:
            found = ", ".join(parts) or "all parts"
            raise InputError("--out", "--part journey or --part peers, whose page it is", found)
        check_suffix(out, ".md", option="--out")
        check_file(out, force=force)
        check_file(out.with_suffix(".png"), force=force)
    _check_figure(figure, out, parts)
    if rounds is not None and parts and "env" not in parts:
        raise InputError("--rounds", "--part env, which is measured in rounds", ", ".join(parts))
    measures = _measures(log, rounds or ROUNDS)
    chosen = parts or PARTS
    # All keys are present even if not measured, so that programs can rely on them.
    figures: dict[str, Any] = {"machine": _machine(), "laser": [], "mapper": [], "env": []}
    figures |= {"journey": [], "generator": [], "processes": {}, "learner": {}, "peers": []}
    with progress("bench", len(chosen), "parts") as update:
        for done, part in enumerate(chosen, start=1):
            figures[part] = measures[part]()
            update(done)
    figures["files"] = []
    if out is not None:
        files = PAGES[paged[0]](out, figures[paged[0]], figures["machine"])
        figures["files"] = [str(path) for path in files]
    if figure is not None:
        figures["files"].append(str(figure.save(journey_figure(figures["journey"]))))
    click.echo(json.dumps(figures) if as_json else as_text(figures))


def _check_figure(figure: FigureFile | None, out: Path | None, parts: Sequence[str]) -> None:
    """Raise InputError if there is a figure, but not the journey that it shows, or in its way."""
    if figure is not None and "journey" not in parts:
        found = ", ".join(parts) or "all parts"
        raise InputError("--figure", "--part journey, which it shows", found)
    if figure is not None and out is not None:
        figure.check_apart((out, out.with_suffix(".png")))


def _measures(log: Path | None, rounds: int) -> dict[str, Callable[[], Any]]:
    """Return each part's measurement. Imports are here because they load the whole simulator."""
    from albot_benchmarks.albot0 import measure_splitting
    from albot_benchmarks.environment import measure_environments, measure_processes
    from albot_benchmarks.generator import measure_generators
    from albot_benchmarks.laser import measure_laser
    from albot_benchmarks.learner import measure_learner
    from albot_benchmarks.long_run import measure_long_run
    from albot_benchmarks.mapper import measure_growth, measure_looping, measure_mappers
    from albot_benchmarks.painting import measure_painting
    from albot_benchmarks.peers import measure_peers
    from albot_benchmarks.ratslam import measure_ratslam
    from albot_benchmarks.slam import measure_slam
    from albot_benchmarks.startup import measure_startup
    from albot_benchmarks.view_spacing import measure_view_spacing

    readings = read_log(log).readings if log else None
    return {
        "laser": measure_laser,
        "mapper": lambda: [
            *(rows := measure_mappers(installed_mappers(), readings)),
            *measure_looping([str(row["name"]) for row in rows if "batch" in row], readings),
            *measure_growth(),
            *measure_splitting(),
        ],
        "views": measure_view_spacing,
        "journey": measure_long_run,
        "env": lambda: measure_environments(rounds=rounds),
        "processes": measure_processes,
        "learner": measure_learner,
        "generator": measure_generators,
        "painting": measure_painting,
        "startup": measure_startup,
        "ratslam": measure_ratslam,
        "slam": lambda: measure_slam(readings),
        "peers": measure_peers,
    }


def _machine() -> dict[str, Any]:
    from albot_benchmarks.timing import calibrate, describe_machine

    return describe_machine() | {"calibration": calibrate()}


Figures = Mapping[str, Any]


def as_text(figures: Figures) -> str:
    """Return a line for the machine, and one for each measured row."""
    machine = figures["machine"]
    calibration = machine["calibration"]
    lines = [
        f"{machine['processor']}, Python {machine['python']}; a fixed piece of work takes "
        f"{calibration['python_ms']:.1f} ms in Python, {calibration['numpy_ms']:.1f} ms in numpy"
    ]
    lines += map(_laser, figures["laser"])
    lines += map(_mapper, figures["mapper"])
    lines += map(_views, figures.get("views", ()))
    lines += map(_journey, figures["journey"])
    lines += map(_environment, figures["env"])
    lines += map(_processes, filter(None, [figures["processes"]]))
    lines += _learner(figures["learner"])
    lines += map(_generator, figures["generator"])
    lines += map(_painting, figures.get("painting", ()))
    lines += map(_ratslam, figures.get("ratslam", ()))
    lines += map(_slam, figures.get("slam", ()))
    lines += map(_peer, figures.get("peers", ()))
    lines += map(_startup, filter(None, [figures.get("startup")]))
    lines += figures.get("files", ())
    return "\n".join(lines)


def _laser(row: Figures) -> str:
    return (
        f"laser       {row['segments']:7,d} walls     {row['us_per_scan']:8.2f} µs/scan in a "
        f"batch, {row['us_per_scan_single']:.2f} alone; pymunk's query in a loop takes "
        f"{row['ratio_to_pymunk']:,.0f} times as long"
    )


def _mapper(row: Figures) -> str:
    if "above_us" in row:
        return (
            f"mapper      {row['robots']:7,d} in a loop {row['above_us']:8.1f} µs/reading above "
            f"the {row['own_us']:.1f} of its own update ({row['ratio']:.2f} times)  {row['name']}"
        )
    if "split_ms" in row:
        return (
            f"mapper      {row['paths']:7,d} robot paths {row['split_ms']:7.1f} ms to split into "
            f"{row['regions']} regions  {row['name']}"
        )
    batch = (
        f"; {row['batch']} at once {row['batch_readings_per_second']:,.0f} in total, "
        f"{row['row_readings_per_second']:,.0f} when each is updated alone"
        if "batch" in row
        else ""
    )
    return (
        f"mapper      {row['surfaces']:7,d} surfaces  "
        f"{row['readings_per_second']:8,.0f} readings/s  {row['name']}{batch}"
    )


def _views(row: Figures) -> str:
    return (
        f"views       {row['spacing_m']:5.1f} m, {row['turn_deg']:2.0f}°     "
        f"{row['speed']:5.2f} times the speed of the first; position error "
        f"{row['error_median_m']:.3f} m, 95 % within {row['error_95_m']:.3f} m, of the last within "
        f"{row['last_95_m']:.3f} m; {row['rooms']} rooms, {row['exits']} exits, {row['places']} "
        f"places  {row['kind']}"
    )


def _journey(row: Figures) -> str:
    return (
        f"journey     {row['path_km']:7.1f} km        {row['us_per_reading']:8.1f} µs/reading  "
        f"({row['ratio']:.1f} times a thousand additions in Python)  {row['name']}: "
        f"{row['surfaces']} surfaces, {row['places']} places, {row['trail_points']} points of "
        f"trail, {row['memory_bytes'] / 1024:,.0f} KiB"
    )


def _environment(row: Figures) -> str:
    inside = f" with {row['mapper']}" if row["mapper"] else ""
    memory = f", {row['memory_mib']:.0f} MiB" if "memory_mib" in row else ""
    threads = f", {row['threads']} threads" if row["threads"] > 1 else ""
    parts = f", which observes {row['parts']}" if row["parts"] else ""
    return (
        f"environment {row['num_envs']:7,d} {row['mode']:9s} {row['steps_per_second']:8,.0f} "
        f"steps/s ({row['steps_per_cpu_second']:,.0f} per second of CPU time), "
        f"{row['ratio']:,.2f} times pymunk's loop: {row['id']}{inside}{parts}, "
        f"{row['segments']} walls{memory}{threads}"
    )


def _processes(row: Figures) -> str:
    return (
        f"processes   {row['processes']:7,d} at once   {row['together']:8,.0f} steps/s in "
        f"total, {row['scaling']:.2f} times one alone ({row['scaling_cpu']:.2f} by CPU "
        f"time): {row['num_envs']} {row['id']} each"
    )


def _learner(row: Figures) -> Iterator[str]:
    if "missing" in row:
        yield f"learner     not measured, missing: {row['missing']}"
    for run in row.get("runs", ()):
        inside = f" with {run['mapper']}" if run["mapper"] else " environment"
        seen = f", {run['policy']}, {run['observation']} numbers"
        yield (
            f"learner     {row['num_envs']:7,d} at once   {run['samples_per_second']:8,.0f} "
            f"samples/s, {run['environment_share']:.0%} of the time in the environment: "
            f"{run['id']}{inside}{seen}"
        )


def _generator(row: Figures) -> str:
    return (
        f"generator   {row['walls']:7,.0f} walls     {row['worlds_per_second']:8,.0f} worlds/s    "
        f"{row['kind']}"
    )


def _painting(row: Figures) -> str:
    return (
        f"painting    {row['width']:4d} × {row['height']:4d}     {row['frames_per_second']:8,.0f} "
        f"pictures/s ({row['frames_per_cpu_second']:,.0f} per second of CPU time), each "
        f"{row['ratio']:.1f} times an empty one: {row['id']} with {row['mapper']}"
    )


def _slam(row: Figures) -> str:
    ratio = row["ratio_to_karto"]
    beside = "" if ratio is None else f", {ratio:.2f} times karto"
    return (
        f"slam        {row['readings_per_second']:8,.0f} readings/s "
        f"({row['readings_per_cpu_second']:,.0f} on a core of its own{beside})  {row['name']}"
    )


def _ratslam(row: Figures) -> str:
    if "num_envs" in row:
        rate = f"{row['steps_per_second']:7,.0f} robot steps/s of a processor"
        return f"batch       {rate}  {row['name']}: {row['num_envs']} environments"
    size = f"{row['experiences']:,d} experiences, {row['transitions']:,d} transitions"
    if "passes_per_second" in row:
        return f"correction  {row['passes_per_second']:7,.0f} passes/s of {size}"
    return (
        f"floor       {row['readings_per_second']:7,.0f} readings/s  {row['name']}: {size}; "
        f"{row['us_early']:.0f} µs a reading early, {row['us_late']:.0f} late"
    )


def _peer(row: Figures) -> str:
    if "missing" in row:
        return f"peer        {row['missing']}: {row['name']}"
    return (
        f"peer        {row['robots']:7,d} at once   {row['steps_per_cpu_second']:8,.0f} steps/s of "
        f"a core, ours {row['ratio']:.1f} times as many: {row['name']}, {row['beams']} beams in "
        f"{row['world']}; ranges {range_accuracy([row])}"
    )


def _startup(row: Figures) -> str:
    return (
        f"start       {row['first_s']:.1f} s compiling everything, {row['later_s']:.2f} s from the "
        f"cache; the README's first episode {row['episode_first_s']:.1f} s "
        f"({row['episode_first_cpu_s']:.1f} s of CPU time), "
        f"{row['episode_later_s']:.2f} s from the cache ({row['episode_later_cpu_s']:.2f} s)"
    )
