"""How much a mapper's error on one real log is luck: map it again and again, slightly disturbed.

    python scripts/perturbed_log.py LOG [--reference FILE] [--mapper NAME] [--runs N]

A log is one run; which of two nearly equal turns is the likelier may hang on a millimetre. Every
run here adds noise far below the sensors' own (5 mm on ranges, 3 mm and 0.1° on motions).
Prints the median, the least and the largest ATE, and of the odometer for comparison.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from albot_cli.main import exit_status
from albot_cli.map_report import run_mapper, score
from albot_core.errors import InputError
from albot_core.logs.log import with_noise
from albot_core.logs.reader import read_log, read_reference


@click.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--reference", type=click.Path(path_type=Path))
@click.option("--mapper", default="albot1", show_default=True)
@click.option("--runs", default=12, show_default=True)
def main(log: Path, reference: Path | None, mapper: str, runs: int) -> None:
    """Map LOG with a little noise, many times."""
    recorded = read_log(log)
    truth = read_reference(reference) if reference else recorded.reference_trajectory
    if truth is None:
        raise InputError(log, "a reference, in the log or by --reference", "none")
    errors = []
    for seed in range(runs):
        run = run_mapper(mapper, with_noise(recorded, np.random.default_rng(seed)), lambda _: None)
        error = score(run.believed, truth, None).trajectory
        if error is None:
            raise InputError(reference or log, "moments of the log", "stamps of another log")
        errors.append(error.rmse)
    click.echo(
        f"{mapper} on {recorded.name}, {runs} runs: ATE median {np.median(errors):.2f} m, "
        f"least {min(errors):.2f}, largest {max(errors):.2f}"
    )


if __name__ == "__main__":
    exit_status(main)
