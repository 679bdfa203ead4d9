"""The figures of `albot bench` for people: a line each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

Figures = Mapping[str, Any]


def as_text(figures: Figures) -> str:
    """A line for the machine, and one for each figure that was measured."""
    machine = figures["machine"]
    calibration = machine["calibration"]
    lines = [
        f"{machine['processor']}, Python {machine['python']}; a fixed piece of work takes "
        f"{calibration['python_ms']:.1f} ms in Python, {calibration['numpy_ms']:.1f} ms in numpy"
    ]
    lines += map(_laser, figures["laser"])
    lines += map(_mapper, figures["mapper"])
    lines += map(_journey, figures["journey"])
    lines += map(_environment, figures["env"])
    lines += map(_processes, filter(None, [figures["processes"]]))
    lines += _learner(figures["learner"])
    lines += map(_generator, figures["generator"])
    lines += map(_startup, filter(None, [figures.get("startup")]))
    return "\n".join(lines)


def _laser(row: Figures) -> str:
    return (
        f"laser       {row['segments']:7,d} walls     {row['us_per_scan']:8.2f} µs/scan in a "
        f"batch, {row['us_per_scan_single']:.2f} alone; pymunk's query in a loop takes "
        f"{row['ratio_to_pymunk']:,.0f} times as long"
    )


def _mapper(row: Figures) -> str:
    batch = (
        f"; {row['batch']} at once {row['batch_readings_per_second']:,.0f} in sum, "
        f"{row['row_readings_per_second']:,.0f} where each is asked by itself"
        if "batch" in row
        else ""
    )
    return (
        f"mapper      {row['surfaces']:7,d} surfaces  "
        f"{row['readings_per_second']:8,.0f} readings/s  {row['name']}{batch}"
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
        f"steps/s ({row['steps_per_cpu_second']:,.0f} on a core of its own), "
        f"{row['ratio']:,.2f} times pymunk's loop: {row['id']}{inside}{parts}, "
        f"{row['segments']} walls{memory}{threads}"
    )


def _processes(row: Figures) -> str:
    return (
        f"processes   {row['processes']:7,d} at once   {row['together']:8,.0f} steps/s in "
        f"sum, {row['scaling']:.2f} times one alone ({row['scaling_cpu']:.2f} on cores of "
        f"their own): {row['num_envs']} {row['id']} each"
    )


def _learner(row: Figures) -> Iterator[str]:
    if "missing" in row:
        yield f"learner     not measured, for want of {row['missing']}"
    for run in row.get("runs", ()):
        inside = f" with {run['mapper']}" if run["mapper"] else " environment"
        yield (
            f"learner     {row['num_envs']:7,d} at once   {run['samples_per_second']:8,.0f} "
            f"samples/s, {run['environment_share']:.0%} of the time in the environment: "
            f"{run['id']}{inside}"
        )


def _generator(row: Figures) -> str:
    return (
        f"generator   {row['walls']:7,.0f} walls     {row['worlds_per_second']:8,.0f} worlds/s    "
        f"{row['kind']}"
    )


def _startup(row: Figures) -> str:
    return (
        f"start       {row['first_s']:.1f} s compiling everything, "
        f"{row['later_s']:.2f} s from the cache"
    )
