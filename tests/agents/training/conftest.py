"""A tiny training that is over, for those who only look at it."""

from __future__ import annotations

from typing import Any

import pytest

from albot_agents.training.plan import TrainingPlan
from albot_agents.training.run import TrainingRun
from albot_agents.training.run_files import RunFolder
from tests.agents.training.tiny import begun

Trained = tuple[RunFolder, TrainingPlan, TrainingRun, dict[str, Any]]


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Trained:
    """Folder, plan, the run, and what came of it."""
    folder, plan = begun(tmp_path_factory.mktemp("trained"))
    run = TrainingRun(folder, plan)
    return folder, plan, run, run.run()
