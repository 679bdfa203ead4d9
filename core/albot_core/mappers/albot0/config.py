"""All thresholds of Albot0; those of each component stand in its file."""

from __future__ import annotations

from dataclasses import dataclass, field

from albot_core.errors import InputError
from albot_core.mappers.albot0.localisation import LocalisationConfig
from albot_core.mappers.albot0.paths import PathConfig
from albot_core.mappers.albot0.regions import RegionConfig
from albot_core.mappers.albot0.trail import TrailConfig
from albot_core.mappers.albot0.way_back import WayBackConfig


@dataclass(frozen=True, kw_only=True)
class Albot0Config:
    """All thresholds of Albot0. `Albot0Config.paper()` returns the paper's, to the letter."""

    paths: PathConfig = field(default_factory=PathConfig)
    """Thresholds of robot paths and surfaces."""
    regions: RegionConfig = field(default_factory=RegionConfig)
    """Thresholds of the split into ASRs."""
    localisation: LocalisationConfig = field(default_factory=LocalisationConfig)
    """Thresholds of the localisation on the way home."""
    trail: TrailConfig | None = field(default_factory=TrailConfig)
    """Thresholds of the particle filter on the trail. None keeps no trail, as in the paper: then
    the robot knows no way home, and has no cue `way`."""
    way_back: WayBackConfig = field(default_factory=WayBackConfig)
    """Thresholds of the way home along the way out."""

    def __post_init__(self) -> None:
        if self.trail is None and "way" in self.localisation.cues:
            expected = "other cues than way, which needs a trail"
            raise InputError("Albot0Config.localisation", expected, "way")

    @classmethod
    def paper(cls) -> Albot0Config:
        """Return the paper's system, to the letter.

        Its cues are distance and orientation. Nothing is carried over from the way out but the
        order, the lengths and the directions of its ASRs.
        """
        return cls(
            regions=RegionConfig.paper(),
            localisation=LocalisationConfig(cues=("distance", "orientation")),
            trail=None,
        )
