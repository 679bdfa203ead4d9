"""What stands in for a training in its process; without PyTorch, which is slow to load."""

from __future__ import annotations

import os
import signal
import time
from multiprocessing.connection import Connection
from typing import Any

from albot_agents.training.journeys import MadeJourneys
from albot_agents.training.plan import TrainingPlan
from albot_agents.training.run_files import RunFolder
from albot_core.errors import InputError


def fail_or_end(folder: RunFolder, plan: TrainingPlan, link: Connection, *shared: Any) -> None:
    """Ends as its seed says."""
    link.send((plan.seed, "here"))
    if plan.seed == 1:
        link.send(InputError("disk", "room"))
    elif plan.seed == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    elif plan.seed == 3:
        os._exit(1)
    else:
        link.send("look")


def make_or_get(
    folder: RunFolder,
    plan: TrainingPlan,
    link: Connection,
    made: MadeJourneys | None,
    shares: bool,
) -> None:
    """Tells what it was given, and sends no journeys if it is to share them."""
    link.send((0, "nothing" if made is None else "journeys"))
    if shares:
        link.send(MadeJourneys())


def wait_for_stop(folder: RunFolder, plan: TrainingPlan, link: Connection, *shared: Any) -> None:
    """Seed 0 goes on until it is to stop, seed 1 whatever it is told; neither for ever."""
    link.send((0, "begun"))
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and (plan.seed == 1 or not link.poll()):
        time.sleep(0.02)
    if link.poll():  # It was told.
        folder.path.touch()
