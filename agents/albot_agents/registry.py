"""Agents by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from albot_agents.agent import Agent, EnvironmentConfigs
from albot_agents.scripted.driving import SENSED_PARTS
from albot_agents.scripted.exploring import (
    AssociationExplorer,
    GapExplorerAgent,
    NearestFrontier,
    OnwardRoundTrip,
    RandomAgent,
    RatSlamExplorer,
    RoundTripAgent,
)
from albot_agents.scripted.followers import HintFollower, HomeVectorFollower, OnwardFollower
from albot_agents.scripted.homing import (
    Albot0Homing,
    Albot1Homing,
    AssociationHoming,
    MapHoming,
    Oracle,
    PathIntegration,
    RatSlamHoming,
)
from albot_agents.scripted.patch_homing import PatchHoming
from albot_agents.scripted.place_judge import DecisionStump, PlaceJudge
from albot_agents.scripted.sahabot_homing import SahabotHoming
from albot_agents.scripted.trained_round_trip import TrainedRoundTrip
from albot_agents.task import config_kind, is_probe, untwinned
from albot_agents.trained.agent_file import KEPT_SETTINGS, SUFFIX, AgentFile, read_agent
from albot_agents.trained.trained_agent import TrainedAgent, shipped_agents
from albot_core.errors import InputError, did_you_mean
from albot_core.files import exists
from albot_core.robot import DEFAULT_ROBOT
from albot_env.tasks.core.actions import ActionConfig
from albot_env.tasks.core.observation import (
    BY_MAP_PARTS,
    DEFAULT_PARTS,
    HOMING_PARTS,
    ObservationConfig,
)
from albot_env.tasks.core.parts.beliefs import CONFIDENCE, PLACE, TIME_LEFT, WAY
from albot_env.tasks.core.parts.ground import ONWARD
from albot_env.tasks.core.parts.matches import MATCHES

EXPLORE, HOMING, BY_MAP = "Albot/Explore-v0", "Albot/Homing-v0", "Albot/HomingByMap-v0"
ROUND_TRIP, PLACES = "Albot/ExploreAndHome-v1", "Albot/PlaceRecognition-v0"

_DRIVING = (*SENSED_PARTS, PLACE.name, MATCHES.name)
"""At what all agents look that drive by laser, and claim to know places."""
_BY_WAY = (*_DRIVING, WAY.name, CONFIDENCE.name)


@dataclass(frozen=True, kw_only=True)
class AgentEntry:
    """An agent that can be made by name."""

    summary: str
    """What it does, in one line."""
    make: Callable[[EnvironmentConfigs], Agent]
    """Makes the agent for an environment."""
    tasks: tuple[str, ...]
    """Ids of the tasks that it can attempt."""
    parts: tuple[str, ...] = DEFAULT_PARTS
    """The parts of observations that a scripted agent expects if it is told of no environment."""
    uses: tuple[str, ...] = ()
    """All parts of observations at which a scripted agent looks, if they are observed."""
    mapper: str = "albot1"
    """The mapper used in evaluations unless another is requested."""
    sensors: Mapping[str, str] = field(default_factory=dict)
    """The sensors used in evaluations unless others are requested, by name of the setting."""
    observations: ObservationConfig | None = None
    """What a scripted agent observes in evaluations unless others are requested; None for
    the task's default."""
    skills: tuple[str, ...] = ()
    """Names of the trained agents of which a scripted one is made."""
    file: AgentFile | None = None
    """The file of a trained agent; None for a scripted one."""

    def attempts(self, task: str) -> bool:
        """Return whether the agent can attempt a task: one of its own, a twin of it, or a probe.

        Whoever comes home can be asked to in the scene of a probe. A trained agent cannot attempt a
        revealed twin of its task, which shows more than its network takes.
        """
        if self.file is not None and task != untwinned(task):
            return task in self.tasks
        comes_home = HOMING in self.tasks or BY_MAP in self.tasks
        return untwinned(task) in self.tasks or (is_probe(task) and comes_home)

    @property
    def configs(self) -> EnvironmentConfigs:
        """The environment that the agent expects."""
        if self.file is None:
            seen = self.observations or ObservationConfig(parts=self.parts)
            return EnvironmentConfigs(seen, ActionConfig())
        seen = self.file.observation_config or ObservationConfig()
        return EnvironmentConfigs(seen, self.file.actions)

    def environment(self, task: str, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Return the settings of an environment in which the agent can act.

        Args:
            task: Id of the environment.
            settings: Settings that override the agent's own, except a trained agent's observations
                and the meaning of its actions.

        Raises:
            InputError: The task has no such settings.
        """
        settings = dict(settings)
        if is_probe(task):  # An agent is shown the hints that it is used to.
            config = settings.get("config") or config_kind(task)()
            settings["config"] = replace(config, hints=config.hints or HOMING in self.tasks)
        if self.file is None:
            if self.observations is not None:
                usual = config_kind(task)()
                config = settings.get("config") or usual
                if config.observations == usual.observations:  # No others are requested.
                    shows = {"hints": True} if hasattr(config, "hints") else {}
                    settings["config"] = replace(config, observations=self.observations, **shows)
            return {"mapper": self.mapper, **self.sensors} | settings
        return self.file.environment(task, settings)

    def untrained_settings(self, settings: Mapping[str, Any]) -> tuple[str, ...]:
        """Return in words which settings differ from those in a trained agent's training.

        Odometer and world are not compared: evaluations may vary them.
        """
        if self.file is None:
            return ()
        learnt: dict[str, Any] = {"mapper_config": "its default parameters", "robot": DEFAULT_ROBOT}
        learnt |= self.file.settings
        learnt |= {"mapper": self.mapper, "config": settings.get("config")}
        return tuple(
            f"{name} {settings[name]} (trained with {learnt.get(name, 'the default')})"
            for name in KEPT_SETTINGS
            if settings.get(name, learnt.get(name)) != learnt.get(name)
        )


AGENTS = {
    Albot0Homing.name: AgentEntry(
        summary="Drives home by sonar alone, until Albot0 says that it is in the home ASR.",
        make=Albot0Homing,
        uses=("sonar", "motion", "home", "exit", "way", "confidence"),
        tasks=(HOMING,),
        mapper="albot0",
        sensors={"laser": "none"},
    ),
    Albot1Homing.name: AgentEntry(
        summary="Drives home through the exits of Albot1's network of places.",
        make=Albot1Homing,
        uses=_BY_WAY,
        tasks=(HOMING, BY_MAP),
    ),
    AssociationExplorer.name: AgentEntry(
        summary="Explores by short moves to nearby gaps, without a memory.",
        make=AssociationExplorer,
        uses=_DRIVING,
        tasks=(EXPLORE,),
        mapper="association",
    ),
    AssociationHoming.name: AgentEntry(
        summary="Drives to the position of home in the global map of landmark association.",
        make=AssociationHoming,
        uses=_BY_WAY,
        tasks=(HOMING, BY_MAP),
        mapper="association",
    ),
    DecisionStump.name: AgentEntry(
        summary="Judges which place it has seen before by one feature over a threshold.",
        make=DecisionStump,
        tasks=(PLACES,),
    ),
    TrainedRoundTrip.name: AgentEntry(
        summary="Explores like the trained exploring, and drives home in time like homing.",
        make=TrainedRoundTrip,
        uses=TrainedRoundTrip.OBSERVATIONS.parts,
        observations=TrainedRoundTrip.OBSERVATIONS,
        skills=TrainedRoundTrip.SKILLS,
        tasks=(ROUND_TRIP,),
    ),
    GapExplorerAgent.name: AgentEntry(
        summary="Explores from gap to gap, the nearest first; reports places known to its mapper.",
        make=GapExplorerAgent,
        uses=_DRIVING,
        tasks=(EXPLORE,),
    ),
    HintFollower.name: AgentEntry(
        summary="Drives straight to the planner's hint, and turns away from what is near.",
        make=HintFollower,
        parts=HOMING_PARTS,
        uses=HintFollower.PARTS,
        tasks=(HOMING,),
    ),
    HomeVectorFollower.name: AgentEntry(
        summary="Drives straight to where home is believed, and turns away from what is near.",
        make=HomeVectorFollower,
        uses=HomeVectorFollower.PARTS,
        tasks=(HOMING, BY_MAP),
    ),
    MapHoming.name: AgentEntry(
        summary="Drives home by the route that its mapper gives, with any mapper.",
        make=MapHoming,
        uses=_BY_WAY,
        tasks=(HOMING, BY_MAP),
        mapper="scan-matching",
    ),
    NearestFrontier.name: AgentEntry(
        summary="Explores by driving to the nearest frontier of the ground that it has covered.",
        make=NearestFrontier,
        uses=_DRIVING,
        tasks=(EXPLORE,),
    ),
    OnwardFollower.name: AgentEntry(
        summary="Explores by driving straight to the planner's hint, to ground that is new.",
        make=OnwardFollower,
        uses=(*OnwardFollower.PARTS, PLACE.name, MATCHES.name),
        observations=OnwardFollower.OBSERVATIONS,
        tasks=(EXPLORE,),
    ),
    OnwardRoundTrip.name: AgentEntry(
        summary="Explores by the planner's hint while there is time, and drives home.",
        make=OnwardRoundTrip,
        uses=(*_DRIVING, CONFIDENCE.name, "map_patch", ONWARD.name, TIME_LEFT.name),
        observations=OnwardRoundTrip.OBSERVATIONS,
        tasks=(ROUND_TRIP,),
    ),
    Oracle.name: AgentEntry(
        summary="Knows the true map and pose, and drives the shortest path home: the upper bound.",
        make=Oracle,
        uses=_DRIVING,
        tasks=(HOMING, BY_MAP),
        mapper="none",
    ),
    PathIntegration.name: AgentEntry(
        summary="Follows the odometer's home vector, without a map.",
        make=PathIntegration,
        uses=_DRIVING,
        tasks=(HOMING, BY_MAP),
        mapper="none",
    ),
    PatchHoming.name: AgentEntry(
        summary="Drives home over what the patch of its map shows, back along its own trail.",
        make=PatchHoming,
        parts=BY_MAP_PARTS,
        uses=(*_DRIVING, "map_patch"),
        tasks=(BY_MAP,),
    ),
    PlaceJudge.name: AgentEntry(
        summary="Judges which place it has seen before, by match scores; does not drive.",
        make=PlaceJudge,
        tasks=(PLACES,),
    ),
    RandomAgent.name: AgentEntry(
        summary="Acts at random: the lower bound.",
        make=RandomAgent,
        mapper="none",
        tasks=(EXPLORE, HOMING, BY_MAP, ROUND_TRIP, PLACES),
    ),
    RatSlamExplorer.name: AgentEntry(
        summary="Explores by taking each route that it sees, in narrow places in both directions.",
        make=RatSlamExplorer,
        uses=_DRIVING,
        tasks=(EXPLORE,),
        mapper="ratslam",
    ),
    RatSlamHoming.name: AgentEntry(
        summary="Drives home by the quickest route over RatSLAM's experience map.",
        make=RatSlamHoming,
        mapper="ratslam",
        uses=_BY_WAY,
        tasks=(HOMING, BY_MAP),
    ),
    RoundTripAgent.name: AgentEntry(
        summary="Explores while there is time, and drives home before it is up.",
        make=RoundTripAgent,
        uses=(*_BY_WAY, "time_left"),
        tasks=(ROUND_TRIP,),
    ),
    SahabotHoming.name: AgentEntry(
        summary="Comes home as the desert ant: home vector, then landmarks, then search.",
        make=SahabotHoming,
        uses=_BY_WAY,
        tasks=(HOMING, BY_MAP),
        mapper="sahabot",
        sensors={"laser": "panoramic", "compass": "polarised"},
    ),
}
"""The scripted agents by name, in alphabetical order."""


def agent_names(task: str | None = None) -> tuple[str, ...]:
    """Return the names of all agents, or of those for a task; scripted ones first, then trained."""
    names = (*AGENTS, *shipped_agents())
    return tuple(name for name in names if task is None or find_agent(name).attempts(task))


def find_agent(name: str) -> AgentEntry:
    """Return the entry of an agent by its name, or by the path of a trained agent's file.

    Raises:
        InputError: No agent has this name (the message suggests the closest one), or the file is
            not an agent file.
    """
    if name in AGENTS:
        return AGENTS[name]
    shipped = shipped_agents()
    if name in shipped:
        return _trained(name, shipped[name])
    if name.endswith(SUFFIX) or (name and exists(Path(name))):  # `Path("")` is this folder.
        return _trained(name, Path(name))
    names = (*AGENTS, *shipped)
    expected = f"one of {', '.join(names)}, or a file"
    raise InputError("agent", expected, f"{name or 'nothing'}{did_you_mean(name, names)}")


def check_agent(name: str, task: str) -> None:
    """Check that an agent exists and is for a task.

    Raises:
        InputError: The agent is unknown, or not for the task.
    """
    entry = find_agent(name)
    if not entry.attempts(task):
        found = f"{name}, which is for {' and '.join(entry.tasks)}"
        raise InputError("agent", f"one for {task}: {', '.join(agent_names(task))}", found)


def _trained(name: str, path: Path) -> AgentEntry:
    """Return the entry of the trained agent in a file."""
    file = read_agent(path)
    algorithm, mapper = file.training.plan.algorithm, file.settings.get("mapper", "albot1")
    parts = file.settings.get("config", {}).get("observations", {}).get("parts", [])
    sees = f"; it sees {', '.join(parts)}" if parts else ""
    return AgentEntry(
        summary=f"Trained for {file.task} by {algorithm}, mapper {mapper}{sees}.",
        make=lambda configs: TrainedAgent(name, file, configs),
        mapper=mapper,
        tasks=(file.task,),
        file=file,
    )


def make_agent(name: str, configs: EnvironmentConfigs | None = None) -> Agent:
    """Make an agent.

    Args:
        name: One of `agent_names`, or the path of a trained agent's file.
        configs: What the agent is told of its environment (`EnvironmentConfigs.of(env)`). By
            default, what is usual, or for a trained agent that of its training.

    Raises:
        InputError: No agent has this name, the file is not an agent file, or the agent was
            trained with other observations or actions.
    """
    entry = find_agent(name)
    return entry.make(entry.configs if configs is None else configs)
