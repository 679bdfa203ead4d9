"""All thresholds of Albot0; those of each part stand beside it."""

from __future__ import annotations

from dataclasses import dataclass, field

from albot_core.mappers.albot0.localisation import LocalisationConfig
from albot_core.mappers.albot0.paths import PathConfig
from albot_core.mappers.albot0.regions import RegionConfig
from albot_core.mappers.albot0.trail import TrailConfig
from albot_core.mappers.albot0.way_back import WayBackConfig


@dataclass(frozen=True, kw_only=True)
class Albot0Config:
    """All thresholds of Albot0."""

    paths: PathConfig = field(default_factory=PathConfig)
    """Robot paths and surfaces."""
    regions: RegionConfig = field(default_factory=RegionConfig)
    """The split into ASRs."""
    localisation: LocalisationConfig = field(default_factory=LocalisationConfig)
    """Where the robot believes to be on its way home."""
    trail: TrailConfig = field(default_factory=TrailConfig)
    """Where the robot is on the way that it came."""
    way_back: WayBackConfig = field(default_factory=WayBackConfig)
    """How the way home leads along the way out."""
