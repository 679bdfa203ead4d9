"""The experiments by name, and the real logs that some of them need."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from albot_agents.engine.engine import Engine
from albot_core.errors import InputError, did_you_mean
from albot_experiments.report import Report

VARIABLE = "ALBOT_DATA"
"""The environment variable that names the folder with the logs."""
FIRST_SEED = 1000
"""The first seed of the reports. Lower seeds are for development: parameters chosen by results on
seeds are not reported on the same seeds."""


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """An experiment of a paper."""

    id: str
    title: str
    seeds: int
    """Default number of seeds."""
    module: str
    """The module with its `run(seeds, progress)`, or `run(task, seeds, progress)` of a probe of
    agents."""
    task: str = ""
    """Id of the environment of a probe of agents; empty for other experiments."""
    needs_data: bool = False
    """Whether it reads real logs."""

    def check(self) -> None:
        """Raise InputError if the data that the experiment needs are not there."""
        if self.needs_data:
            data_folder()

    @property
    def default_seeds(self) -> range:
        """The seeds over which the experiment runs by default."""
        return range(FIRST_SEED, FIRST_SEED + self.seeds)

    def run(
        self,
        seeds: range,
        progress: Callable[[int], None],
        engine: Engine | None = None,
        **options: str,
    ) -> Report:
        """Run the experiment over the seeds; call `progress` with the number of seeds done.

        Args:
            seeds: The seeds.
            progress: Called with the number of seeds done.
            engine: Runs the episodes of a probe of agents; None for processes, one a core. All else
                runs in this process.
            options: `agent`, `mapper` and `odometer` of a probe of agents.

        Raises:
            InputError: Options are given, but it is no probe of agents; or as the experiment says.
        """
        if options and not self.task:
            probes = ", ".join(name for name, each in EXPERIMENTS.items() if each.task)
            raise InputError(f"--{next(iter(options))}", f"a probe of agents: {probes}", self.id)
        run = importlib.import_module(self.module).run
        if not self.task:
            report: Report = run(seeds, progress)
        else:
            report = run(self.task, seeds, progress, engine=engine, **options)
        return report


EXPERIMENTS = {
    experiment.id: experiment
    for experiment in (
        Experiment(
            id="albot0-1",
            title="Albot0's way home by ASR lengths and turns (Schmidt et al.)",
            seeds=20,
            module="albot_experiments.albot0_return",
        ),
        Experiment(
            id="albot0-2",
            title="Albot0's ASRs of a room larger than its sonars reach (Schmidt et al.)",
            seeds=20,
            module="albot_experiments.albot0_hall",
        ),
        Experiment(
            id="albot0-homing",
            title="Albot0 drives out and home by sonars alone (Schmidt et al.)",
            seeds=20,
            module="albot_experiments.albot0_homing",
        ),
        Experiment(
            id="albot0-lost-frame",
            title="Albot0 comes home in another frame than that of its way out (Schmidt et al.)",
            seeds=20,
            module="albot_experiments.albot0_lost_frame",
        ),
        Experiment(
            id="albot0-spaces",
            title="Albot0's seven local spaces, out and home (Hossain 2014, figure 2.21)",
            seeds=20,
            module="albot_experiments.albot0_spaces",
        ),
        Experiment(
            id="albot1-e1",
            title="Albot1's map keeps the shape of the floor (Hossain 2014, section 3.2.1)",
            seeds=100,
            module="albot_experiments.albot1_e1",
        ),
        Experiment(
            id="albot1-e1b",
            title="Albot1 updates and wipes its map (Hossain 2014, section 3.2.1)",
            seeds=100,
            module="albot_experiments.albot1_e1b",
        ),
        Experiment(
            id="albot1-e2",
            title="Albot1 knows where home is (Hossain 2014, section 3.2.2)",
            seeds=100,
            module="albot_experiments.albot1_e2",
        ),
        Experiment(
            id="albot1-e3",
            title="Albot1 bears a wrong odometer (Hossain 2014, section 3.2.3)",
            seeds=100,
            module="albot_experiments.albot1_e3",
        ),
        Experiment(
            id="albot1-e4",
            title="Albot1 maps without stopping (Hossain 2014, section 3.2.4)",
            seeds=100,
            module="albot_experiments.albot1_e4",
        ),
        Experiment(
            id="albot1-e4b",
            title="Albot1 removes a little more than it sees (Hossain 2014, section 3.2.4)",
            seeds=20,
            module="albot_experiments.albot1_e4b",
        ),
        Experiment(
            id="albot1-e5",
            title="Albot1 maps from few views (Hossain 2014, section 3.2.5)",
            seeds=100,
            module="albot_experiments.albot1_e5",
        ),
        Experiment(
            id="albot1-e6",
            title="Albot1 maps public logs (Hossain 2014, section 3.2.6)",
            seeds=20,
            module="albot_experiments.albot1_e6",
            needs_data=True,
        ),
        Experiment(
            id="albot1-c1",
            title="Albot1 learns a network of places (Hossain 2014, section 4.2.1)",
            seeds=100,
            module="albot_experiments.albot1_c1",
        ),
        Experiment(
            id="albot1-c2",
            title="Albot1 recognizes familiar places (Hossain 2014, section 4.2.2)",
            seeds=100,
            module="albot_experiments.albot1_c2",
        ),
        Experiment(
            id="albot1-c3",
            title="Albot1 knows which exit comes next (Hossain 2014, section 4.2.3)",
            seeds=100,
            module="albot_experiments.albot1_c3",
        ),
        Experiment(
            id="albot1-readings",
            title="Three readings of Albot1's thesis, each alone (Hossain 2014)",
            seeds=20,
            module="albot_experiments.albot1_readings",
            needs_data=True,
        ),
        Experiment(
            id="fastslam-consistency",
            title="FastSLAM's error against the uncertainty that it believes in (Bailey 2006)",
            seeds=50,
            module="albot_experiments.fastslam_consistency",
        ),
        Experiment(
            id="hssh-gateways",
            title="HSSH's gateways on real floor plans, beside their doors (Beeson et al. 2010)",
            seeds=5,
            module="albot_experiments.hssh_gateways",
            needs_data=True,
        ),
        Experiment(
            id="hssh-homing",
            title="HSSH comes home over its places and paths in random offices",
            seeds=20,
            module="albot_experiments.hssh_homing",
        ),
        Experiment(
            id="hssh-tree",
            title="HSSH's tree of topological maps on nested loops (Beeson et al. 2010)",
            seeds=20,
            module="albot_experiments.hssh_tree",
        ),
        Experiment(
            id="ratslam-loop",
            title="RatSLAM closes loops under odometric error (Milford et al. 2005, section 5.2)",
            seeds=20,
            module="albot_experiments.ratslam_loop",
        ),
        Experiment(
            id="ratslam-floor",
            title="RatSLAM maps a whole office floor (Milford et al. 2005, section 5.3)",
            seeds=20,
            module="albot_experiments.ratslam_floor",
        ),
        Experiment(
            id="ratslam-office",
            title="RatSLAM maps an open plan office (Milford et al. 2005, section 6)",
            seeds=20,
            module="albot_experiments.ratslam_office",
        ),
        Experiment(
            id="ratslam-deliveries",
            title="RatSLAM delivers in an office (Wyeth and Milford 2009, in Hossain 2014)",
            seeds=20,
            module="albot_experiments.ratslam_deliveries",
        ),
        Experiment(
            id="association-1",
            title="Landmark association keeps the shape of the floor (Yeap et al. 2015)",
            seeds=20,
            module="albot_experiments.association_1",
        ),
        Experiment(
            id="association-2",
            title="Landmark association of a robot that wanders on its own (Yeap et al. 2015)",
            seeds=20,
            module="albot_experiments.association_2",
        ),
        Experiment(
            id="ratslam-real",
            title="RatSLAM with a laser on real logs (Milford et al. 2005, section 6)",
            seeds=20,
            module="albot_experiments.ratslam_real",
            needs_data=True,
        ),
        Experiment(
            id="sahabot-1",
            title="Sahabot 2's path integration by compass over 255 m (thesis, figure 2.12c)",
            seeds=20,
            module="albot_experiments.sahabot_1",
        ),
        Experiment(
            id="sahabot-2",
            title="Sahabot 2's home vectors by 4 and by 27 landmarks (thesis, figure 2.13)",
            seeds=20,
            module="albot_experiments.sahabot_2",
        ),
        Experiment(
            id="ants",
            title="The desert ant's approximate integration and its search (thesis, figure 2.11)",
            seeds=100,
            module="albot_experiments.ants",
        ),
        Experiment(
            id="probe-triangle-completion",
            title="Path integration: home after two legs over an open floor (Loomis et al. 1993)",
            seeds=54,
            module="albot_experiments.probes",
            task="Albot/Probe-TriangleCompletion-v0",
        ),
        Experiment(
            id="probe-sunburst",
            title="A shortcut that was never driven (Tolman et al. 1946)",
            seeds=20,
            module="albot_experiments.probes",
            task="Albot/Probe-Sunburst-v0",
        ),
        Experiment(
            id="probe-detour",
            title="The shorter detour round a barrier (Köhler 1925)",
            seeds=20,
            module="albot_experiments.probes",
            task="Albot/Probe-Detour-v0",
        ),
        Experiment(
            id="probe-rectangle",
            title="Geometry against a feature, in a rectangular room (Cheng 1986)",
            seeds=60,
            module="albot_experiments.probes",
            task="Albot/Probe-Rectangle-v0",
        ),
        Experiment(
            id="probe-hidden-goal",
            title="A hidden goal by distant cues (Morris 1981)",
            seeds=40,
            module="albot_experiments.probes",
            task="Albot/Probe-HiddenGoal-v0",
        ),
        Experiment(
            id="probe-pointing",
            title="Pointing before and after disorientation (Wang and Spelke 2000)",
            seeds=40,
            module="albot_experiments.probe_pointing",
        ),
        Experiment(
            id="probe-jrd",
            title="Judgements of relative direction (Waller and Hodgson 2006)",
            seeds=40,
            module="albot_experiments.probe_jrd",
        ),
        Experiment(
            id="probe-axes",
            title="Imagined headings along and across an intrinsic axis (Mou and McNamara 2002)",
            seeds=40,
            module="albot_experiments.probe_axes",
        ),
    )
}

ABLATED = tuple(
    name for name in EXPERIMENTS if name.startswith("albot1-") and name != "albot1-readings"
)
"""The experiments that compare Albot1's mappers, for the ablation table."""


def find_experiment(name: str) -> Experiment:
    """Return the experiment of a name.

    Raises:
        InputError: There is no such experiment.
    """
    if name in EXPERIMENTS:
        return EXPERIMENTS[name]
    found = f"{name!r}{did_you_mean(name, EXPERIMENTS)}"
    raise InputError("experiment", f"one of {', '.join(sorted(EXPERIMENTS))}", found)


def data_folder() -> Path:
    """Return the folder with the real logs.

    Raises:
        InputError: The environment variable is not set, or the folder lacks the logs.
    """
    named = os.environ.get(VARIABLE)
    if not named:
        raise InputError(VARIABLE, "the folder that holds the real logs, as logs/", "not set")
    if not (Path(named) / "logs").is_dir():
        raise InputError(VARIABLE, "a folder that holds logs/", named)
    return Path(named)
