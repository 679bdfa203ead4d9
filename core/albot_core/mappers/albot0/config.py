"""All thresholds of Albot0; those of each component stand in its file."""

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
    """Thresholds of robot paths and surfaces."""
    regions: RegionConfig = field(default_factory=RegionConfig)
    """Thresholds of the split into ASRs."""
    localisation: LocalisationConfig = field(default_factory=LocalisationConfig)
    """Thresholds of the localisation on the way home."""
    trail: TrailConfig = field(default_factory=TrailConfig)
    """Thresholds of the particle filter on the trail."""
    way_back: WayBackConfig = field(default_factory=WayBackConfig)
    """Thresholds of the way home along the way out."""
