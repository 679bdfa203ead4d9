"""Parameters of the Hybrid Spatial Semantic Hierarchy."""

from __future__ import annotations

from dataclasses import dataclass, field

from albot_core.mappers.hssh.gateways import GatewayConfig
from albot_core.mappers.hssh.map_tree import TreeConfig
from albot_core.mappers.slam.grid import GridConfig
from albot_core.mappers.slam.local_map import MatchingConfig
from albot_core.ranges import COUNT, NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields

_LIMIT = Range("a positive number or infinity", 0.0, beyond=True, infinite=True)


@dataclass(frozen=True, kw_only=True)
class PlaceConfig:
    """How a visit is compared with a known place, and when. All values are ours."""

    search: float = 0.5
    """Distance driven from one search for gateways to the next (m)."""
    beyond: float = 0.3
    """Distance behind a gateway at which the robot has left the place (m)."""
    near: float = 0.8
    """Largest distance between a gateway and the same one as found again (m)."""
    gateway_error: float = 0.5
    """Root mean square distance of the ends of matched gateways, at most (m)."""
    surface_error: float = 0.2
    """Largest distance between a point on a wall and the same wall on another visit (m)."""
    overlap: float = 0.8
    """Smallest share of the points on walls that must be found again, of those of which the other
    visit saw anything: the paper's match of the local maps. 0 matches the stars alone."""
    around: float = 3.0
    """Largest distance of these points from the middle of the place (m). Where the nearest wall is
    farther than that, less `beside`, they lie up to `beside` behind it."""
    beside: float = 1.0
    """How far the points reach behind the nearest wall of a wide place (m)."""
    evidence: int = 40
    """Smallest number of points on walls of which the other visit saw anything, of both visits
    together: with fewer, places that were not seen whole are not taken for the same. Their stars
    tell little."""
    points: int = 120
    """Largest number of points on walls that are kept of a visit."""
    drift: float = 0.05
    """Largest error of the odometry as a share of the distance driven since the earlier visit, and
    1 m besides. Hypotheses that need more are refused, which is ours: in an office of equal rooms
    too many are left otherwise. Infinity, as in the paper: the topological map does not depend on
    the metric layout."""
    claim: float = 1.0
    """Largest distance from a reading of an earlier visit at which the robot is believed to be
    where it was (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "search", "near", "gateway_error", "surface_error", "claim")
        check_fields(self, NOT_NEGATIVE, "beyond", "around", "beside")
        check_fields(self, COUNT, "points", "evidence")
        check_fields(self, SHARE, "overlap")
        check_fields(self, _LIMIT, "drift")


@dataclass(frozen=True, kw_only=True)
class HsshConfig:
    """All parameters of the mapper."""

    matching: MatchingConfig = field(default_factory=MatchingConfig)
    """Matching of a scan with the latest ones: localisation in the local perceptual map."""
    grid: GridConfig = field(default_factory=lambda: GridConfig(cell=0.05, reach=8.0))
    """The cells of the local perceptual map."""
    half: float = 6.0
    """Half the side of the square around the robot in which gateways are searched (m). The local
    perceptual map reaches as far as the beams, if that is farther."""
    gateways: GatewayConfig = field(default_factory=GatewayConfig)
    """What counts as a gateway."""
    places: PlaceConfig = field(default_factory=PlaceConfig)
    """How visits are compared."""
    tree: TreeConfig = field(default_factory=lambda: TreeConfig(limit=500))
    """The tree of topological maps."""
    ahead: float = 1.0
    """Distance of the point that is reported of the way home, at least (m)."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "half", "ahead")
