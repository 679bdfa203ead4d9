"""Parameters of RatSLAM. The paper gives few values; each field says whose its value is."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args, get_type_hints

from albot_core.errors import InputError
from albot_core.ranges import (
    COUNT,
    FROM_ONE,
    FROM_TWO,
    NOT_NEGATIVE,
    POSITIVE,
    SHARE,
    Range,
    check_fields,
)

_SIDE = Range("a whole number from 16", 16.0, 4096.0, whole=True)
_BINS = Range("a whole number from 8 to 180", 8.0, 180.0, whole=True)
_AT_LEAST_ONE = Range("a number from 1", 1.0)
_RATE = Range("a number within (0, 1)", 0.0, math.nextafter(1.0, 0.0), beyond=True)
_ANGLE = Range("an angle within (0, pi]", 0.0, math.pi, beyond=True)


DIRECTIONS = 180
"""Number of directions of a panorama."""


@dataclass(frozen=True, kw_only=True)
class PoseCellConfig:
    """The competitive attractor network of pose cells (sections 3.2 and 3.3)."""

    columns: int = 128
    """Number of cells along x', which wraps round. Our value; the paper gives no size."""
    rows: int = 128
    """Number of cells along y', which wraps round. Our value."""
    headings: int = 36
    """Number of cells along θ'; each spans 10°, as in the paper."""
    cell: float = 0.25
    """Side of a cell (m), as in the paper."""
    excitation: float = 1.2
    """Standard deviation of a cell's excitation of its neighbours (cells). Our value."""
    inhibition: float = 2.0
    """Standard deviation of a cell's local inhibition (cells). Our value."""
    global_inhibition: float = 2e-4
    """Activity that every cell loses in each iteration, as a share of all activity. The larger it
    is, the sooner the largest packet wins. Our value."""
    step: float = 0.1
    """Distance since the last iteration that starts the next one (m), so that the rate of readings
    does not matter. Our value."""
    turn: float = math.radians(10.0)
    """Turn since the last iteration that starts the next one (rad). Our value."""

    def __post_init__(self) -> None:
        check_fields(self, _SIDE, "columns", "rows", "headings")
        check_fields(self, POSITIVE, "cell", "excitation", "inhibition")
        check_fields(self, NOT_NEGATIVE, "global_inhibition", "step", "turn")
        if self.excitation >= self.inhibition:
            expected = f"more than excitation, {self.excitation:g}"
            raise InputError("PoseCellConfig.inhibition", expected, f"{self.inhibition:g}")

    @property
    def cell_turn(self) -> float:
        """Angle that a cell spans (rad)."""
        return 2 * math.pi / self.headings


@dataclass(frozen=True, kw_only=True)
class LocalViewConfig:
    """Scenes, and the links from views to pose cells (section 3.4). All values are ours."""

    confirmations: int = 2
    """Number of readings in a row that must show a scene before it is believed. 1: at once, as in
    the paper."""
    forget_after: int = 30
    """Number of readings in a row without the believed scene after which it is forgotten."""
    injection: float = 0.04
    """Activity that a fresh view injects in each iteration, as a share of all activity."""
    fatigue: float = 0.9
    """Share of a view's freshness that is left after an iteration in which it is seen. 1: a view
    injects as much for as long as it is seen, as in the paper."""
    recovery: float = 0.05
    """Freshness that a view regains in each iteration in which it is not seen."""
    learning_rate: float = 1.0
    """λ: strength of a new link, as a factor of view activity times pose cell activity."""
    learning_delay: float = 5.0
    """Distance that the robot must drive without a re-localisation before a link is learned (m). 0:
    none, as in the paper."""
    linked_share: float = 0.5
    """Pose cells with at least this share of the highest activity are linked to a view."""
    links_in_sight: bool = False
    """Whether a scene is linked in every iteration in which it is seen, and injects at its linked
    cells, as the paper says: views and cells that are active together are linked. If not, it is
    linked where it comes into sight, and what it injects moves on with the robot."""

    def __post_init__(self) -> None:
        check_fields(self, FROM_ONE, "confirmations", "forget_after")
        check_fields(self, POSITIVE, "learning_rate")
        check_fields(self, NOT_NEGATIVE, "injection", "learning_delay")
        check_fields(self, SHARE, "fatigue", "recovery", "linked_share")


@dataclass(frozen=True, kw_only=True)
class PanoramaConfig:
    """Panoramas, the local views of a laser. All values are ours."""

    max_range: float = 8.0
    """Largest range (m); longer ranges are cut to it."""
    path_length: float = 5.0
    """Length of the path whose scans make up a panorama (m)."""
    scan_spacing: float = 0.3
    """Approximate distance between the scans of a panorama (m)."""
    scans: int = 30
    """Largest number of scans in a panorama."""
    bins: int = 36
    """Number of sectors of the profiles, which are compared at all rotations."""
    overlap: float = 0.4
    """Smallest share of the circle that both profiles must know to be compared."""
    candidates: int = 8
    """Largest number of views that are aligned: those whose profiles differ least."""
    candidate_ratio: float = 1.6
    """Largest profile difference of a view that is aligned, as a multiple of the smallest one."""
    min_score: float = 0.4
    """Smallest match score at which a view counts as seen."""
    max_distance: float = 1.6
    """Largest distance from the origin of a view's frame at which the view counts as seen (m)."""
    min_alignment_score: float = 0.6
    """Smallest match score at which alignment with a view replaces the odometer's pose in it."""
    max_deviation: float = 0.1
    """Largest difference from the odometer at which an alignment is accepted (rad; twice as many
    m). `max_deviation_share` of the motion is added."""
    max_deviation_share: float = 0.25
    """Share of the motion since the last scan that is added to `max_deviation`."""
    doubtful: float = 0.1
    """Mean share of the directions that disagree after the alignments along a way, from which the
    robot is as unsure of that way as `drift` and `turn_drift` say; it is surer in proportion where
    fewer disagree."""
    new_place_weight: float = 0.02
    """Weight of the case that the robot is where no view was learned; a perfect match at the
    expected pose has weight 1. The larger it is, the longer it takes until views that match poorly,
    or lie far from the expected pose, re-localise the robot."""
    spread: float = 0.5
    """Standard deviation of the believed position in a view that was just seen (m)."""
    drift: float = 0.05
    """Growth of `spread` with the distance driven since the view was last seen (m/m), where
    alignments are doubtful."""
    turn_spread: float = 0.15
    """Standard deviation of the believed heading in a view that was just seen (rad)."""
    turn_drift: float = 0.01
    """Growth of `turn_spread` with the distance driven since the view was last seen (rad/m), where
    alignments are doubtful."""

    def __post_init__(self) -> None:
        check_fields(
            self,
            POSITIVE,
            "max_range",
            "path_length",
            "max_distance",
            "doubtful",
            "new_place_weight",
            "spread",
            "turn_spread",
        )
        check_fields(
            self,
            NOT_NEGATIVE,
            "scan_spacing",
            "max_deviation",
            "max_deviation_share",
            "drift",
            "turn_drift",
        )
        check_fields(self, FROM_TWO, "scans")
        check_fields(self, FROM_ONE, "candidates")
        check_fields(self, _AT_LEAST_ONE, "candidate_ratio")
        check_fields(self, SHARE, "overlap", "min_score", "min_alignment_score")
        check_fields(self, _BINS, "bins")
        if DIRECTIONS % self.bins:
            expected = f"a divisor of {DIRECTIONS}, the directions of a panorama"
            raise InputError("PanoramaConfig.bins", expected, str(self.bins))


@dataclass(frozen=True, kw_only=True)
class ExperienceConfig:
    """The zones of influence of experiences (section 4.1). The paper gives no values: ours."""

    radius: float = 1.15
    """r_a: radius of the zone in the plane of the pose cells (m)."""
    turn: float = math.radians(45.0)
    """θ_a: half the zone's width in θ' (rad)."""
    position_or_heading: bool = False
    """Whether one zone, in (x', y') or in θ', is enough for an experience to be active, as eq. (9)
    literally says. If so, a scene that two places share, or a false scene, at once activates an
    experience far away."""
    min_revisit_distance: float = 3.0
    """An experience is recognised if the robot has driven this far since it was last there (m)."""
    visits: int = 1
    """Number of visits in a row at which a scene that is known from elsewhere must be seen at a
    known place, until an experience is made there. 1: at once, as in eq. (11). 2 for a camera whose
    false scenes last for seconds: they are rarely seen so twice. Then the map also learns later
    that two places truly share a scene."""
    confirmations: int = 4
    """Number of known experiences that must be entered after a re-localisation, without another
    one, before it is believed. Until then, transitions to known experiences wait; those of a false
    re-localisation are never learned. 0: every re-localisation is believed at once."""
    smoothing: float = 0.2
    """Smallest weight of the view against map and odometer, when it gives the robot's pose in a
    known experience that it enters. A scene gives that pose only to 1 m and 45°. The weight is 1 at
    a re-localisation, then 1/2, 1/3 and so on. 1: only the view is believed."""
    at_experiences: bool = False
    """Whether a robot with a camera that enters a known experience is taken to be at it, so that
    transitions begin and end at experiences, as in section 4.2. If not, the pose cells say where in
    its zone the robot is."""
    spacing: float = 0.6
    """Smallest distance from the last experience at which a robot with a laser makes a new one
    while it still sees the last (m)."""
    min_score: float = 0.5
    """Smallest match score at which a robot with a laser sees an experience."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "radius")
        check_fields(self, _ANGLE, "turn")
        check_fields(self, NOT_NEGATIVE, "min_revisit_distance", "spacing")
        check_fields(self, SHARE, "min_score", "smoothing")
        check_fields(self, COUNT, "confirmations")
        check_fields(self, FROM_ONE, "visits")


@dataclass(frozen=True, kw_only=True)
class CorrectionConfig:
    """The correction of the experience map (sections 4.3 and 4.4)."""

    form: Literal["link_by_link", "all_at_once", "all_at_once_limited"] = "link_by_link"
    """`link_by_link`: each link moves its two experiences, equally and oppositely, before the next
    link is processed; stable for every rate below 1. `all_at_once`: eq. (12) to (14) as the paper
    writes them, for all experiences from the same poses. This diverges unless the rate is below 2 /
    the largest eigenvalue of the graph's Laplacian, so it fails at junctions.
    `all_at_once_limited`: the same, but the rate of an experience with n links is at most 1 / n, so
    that none moves beyond the mean of where its links put it."""
    rate: float = 0.5
    """α for positions and headings, as in the paper (table 1)."""
    recognised: float = 0.1
    """Weight of a transition between poses of which one is known by one scene alone, and the other
    exactly; that of the odometer alone has 1. It is nearly this share of α when first driven; the
    weights of all drives add up, to at most 1, and the motion is their weighted mean. In the paper
    all transitions weigh the same. Our value."""
    passes: int = 3
    """Number of passes over all links in each iteration; 0 corrects nothing. Our value."""

    def __post_init__(self) -> None:
        check_fields(self, _RATE, "rate")
        check_fields(self, POSITIVE, "recognised")
        check_fields(self, COUNT, "passes")
        if self.form not in (forms := get_args(get_type_hints(CorrectionConfig)["form"])):
            expected = f"one of {', '.join(forms)}"
            raise InputError("CorrectionConfig.form", expected, repr(self.form))


@dataclass(frozen=True, kw_only=True)
class RatSlamConfig:
    """Parameters of RatSLAM: by default with a laser, by `RatSlamConfig.scenes()` with a camera."""

    sees: Literal["laser", "scenes"] = "laser"
    """Where views come from: panoramas of laser scans, or numbers of visual scenes."""
    pose_cells: PoseCellConfig = field(
        default_factory=lambda: PoseCellConfig(step=0.25, turn=math.radians(20.0))
    )
    """The network of pose cells."""
    views: LocalViewConfig = field(default_factory=lambda: LocalViewConfig(injection=0.2))
    """Scenes, and the links from views to pose cells."""
    panoramas: PanoramaConfig = field(default_factory=PanoramaConfig)
    """The views of a laser."""
    experiences: ExperienceConfig = field(
        default_factory=lambda: ExperienceConfig(radius=1.5, confirmations=0)
    )
    """When an experience is active, made or recognised."""
    correction: CorrectionConfig = field(default_factory=lambda: CorrectionConfig(passes=10))
    """How the map is corrected."""
    ahead: float = 2.0
    """Distance along the way home of the point that is shown ahead (m). Our value."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "ahead")
        if self.sees not in ("laser", "scenes"):
            raise InputError("RatSlamConfig.sees", "laser or scenes", repr(self.sees))

    @classmethod
    def scenes(cls) -> RatSlamConfig:
        """Return the default parameters for a camera, with more frequent iterations.

        A scene stays in sight for a metre, and its links lead to where it came into sight. So it
        injects most at once; later it would pull the packet back. It is linked to few more than
        the most active cell, so that what it injects is no wider than a packet.
        """
        return cls(
            sees="scenes",
            pose_cells=PoseCellConfig(),
            views=LocalViewConfig(
                injection=0.14, fatigue=0.6, learning_delay=3.0, linked_share=0.8
            ),
            experiences=ExperienceConfig(),
            correction=CorrectionConfig(),
        )

    @classmethod
    def paper(cls) -> RatSlamConfig:
        """Return the parameters by which a robot with a camera follows the paper to the letter.

        What is linked, injected, made and corrected is as its text and equations say. The values
        that it does not give are those of `scenes`, but for the injection, which does not tire.

        The one departure is the limited rate: with α = 0.5 eq. (12) to (14) diverge at junctions of
        four transitions.
        """
        return cls(
            sees="scenes",
            pose_cells=PoseCellConfig(),
            views=LocalViewConfig(
                confirmations=1,
                injection=0.15,
                fatigue=1.0,
                learning_delay=0.0,
                links_in_sight=True,
            ),
            experiences=ExperienceConfig(
                position_or_heading=True,
                visits=1,
                confirmations=0,
                smoothing=1.0,
                at_experiences=True,
            ),
            correction=CorrectionConfig(form="all_at_once_limited", recognised=1.0, passes=1),
        )
