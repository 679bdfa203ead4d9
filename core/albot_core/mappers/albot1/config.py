"""All thresholds of Albot1. The defaults are those of `albot1`; `thesis()` gives the thesis's."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from albot_core.matching.line_matching import MatchConfig
from albot_core.ranges import FROM_ONE, NOT_NEGATIVE, POSITIVE, SHARE, Range, check_fields
from albot_core.sensing.view import ViewConfig

_ANGLE = Range("a number from 0 to pi (rad)", 0.0, math.pi)
_HEIGHT = Range("a number from 0, or infinity", 0.0, infinite=True)


class Albot1Limits(NamedTuple):
    """The values of `Albot1Config` that compiled code needs (m, rad)."""

    view_spacing: float
    view_turn: float
    landmark_length: float
    landmark_angle: float
    landmark_cosine: float
    landmark_gap: float
    min_landmarks: int
    margin: float
    robot_in_boundary: bool
    keeps_outer_end: bool
    join_height: float
    submap_matching: bool
    joint_landmarks: bool
    longest_landmark: bool
    covered_is_reobserved: bool
    remembers_places: bool
    match_range: float
    motion_error: float
    turn_error: float
    min_exit_width: float
    max_exit_width: float
    compare_spacing: float
    compare_turn: float
    compares_at_updates: bool
    turn_cost: float
    turn_scale: float
    unsure: float
    turn_search: float


@dataclass(frozen=True, kw_only=True)
class PlacesConfig:
    """Thresholds of the network of places (chapter 4)."""

    match: MatchConfig = field(default_factory=MatchConfig)
    """When two surfaces match, and two places (section 4.1.2). In the thesis surfaces match up to
    0.40 m apart, and the position of a matching place is not limited."""
    min_matches: int = 4
    """Places are one only if more of their surfaces than this match (algorithm 6, line 11)…"""
    min_probability: float = 0.93
    """…and if the probability that they are one is at least this (`places/evidence.py`). At 0, as
    in `albot1-thesis` and `albot1-tracked`, no probability is computed, and the shares below
    decide."""
    takes_first_match: bool = False
    """Whether two places are compared in the first alignment of more than `min_matches` surfaces on
    both sides of the robot (algorithm 6, lines 11 to 13). If off, they are in the alignment in
    which most surfaces match, whose sides are tested afterwards. On in the thesis."""
    min_share: float = 0.3
    """Minimum share of the smaller description that must match (thesis: any)."""
    reobserved_share: float = 0.1
    """A place is a loop-closure candidate if more of its surfaces are observed again than its gate.
    The gate is this share of all its surfaces…"""
    min_reobserved: int = 2
    """…but at least this number…"""
    max_reobserved: int = 8
    """…and at most this number. The thesis says only that n grows with the place's size."""
    counts_by_place: bool = False
    """Whether the surfaces observed again are counted for their place, over all visits to it
    (section 4.1.2: "to which places these surfaces belong"). If off, each visit counts alone,
    because the map may have drifted between two visits. On in the thesis."""
    candidates_seen_through_exits: bool = True
    """Whether, when the robot enters a new place, the places that were candidates just before are
    candidates still, although nothing more of them is observed. Off in the thesis."""
    candidates_by_position: bool = True
    """Whether, when the robot enters a new place, the known places whose bounding box holds its
    estimated position are candidates as well. Off in the thesis."""
    min_share_here: float = 0.7
    """Minimum share of the smaller description that must match for such a candidate, where no
    probability is computed."""
    expects_drift: bool = True
    """Whether the map may have drifted. The distance at which a known exit or place is accepted
    then grows with the distance travelled since the map was last aligned. Off in `albot1-thesis`
    and `albot1-tracked`."""
    mends_missed_crossings: bool = True
    """Whether a robot that crosses a known exit of its place from the outside, or (with
    `expects_drift`) an exit of the next place, is taken to have gone out unnoticed. If off, it
    enters a new place. Off in the thesis."""
    must_stand_within: bool = True
    """Whether places are one only if the robot would stand within the other place, on the inner
    side of all its exits, where no probability is computed. Off in the thesis."""
    keeps_believed_pose: bool = True
    """Whether a recognised place is laid where the map expects it, if at most one surface fewer
    matches there. If off, it is always laid where it was found, as in the thesis and in
    `albot1-tracked`."""
    compare_spacing: float = 0.7
    """Places are compared again after the robot has moved this far (m)…"""
    compare_turn: float = np.radians(45.0)
    """…or turned this far (rad)."""
    compares_at_updates: bool = False
    """Whether places are instead compared whenever a view is laid over the map (section 4.1.2), and
    only then. On in `albot1-thesis` and `albot1-tracked`."""
    uses_expected_exits: bool = True
    """Whether known exits are crossed where they are expected, even if they are not seen. Off in
    the thesis."""
    tolerance: float = 0.40
    """A correction of the map smaller than this (m) is not applied."""
    aligns_by_exit_seen: bool = False
    """Whether the place behind a known exit is aligned by the exit just crossed as it is seen, in
    position and direction (section 4.2.3; algorithm 7, line 13). If off, it is aligned by what both
    places remember of the exit, is not turned, and is not moved by less than `tolerance`. On in
    the thesis. The next exits are then nearer to where they are expected (`albot1-c3`), but a
    doorway seen in passing turns the place by up to some 10°: on long journeys more rooms are not
    recognised, and are learned again (docs/places.md)."""
    min_relocalise_matches: int = 7
    """Minimum number of matching surfaces at which a robot that was carried away recognises a
    place. The probability of that place must reach `min_probability` as well
    (`places/hypothesis.py`)."""
    min_relocalise_probability: float = 0.93
    """Probability of a place at which a robot that was carried away recognises it. Without effect
    where no probability is computed (`min_probability` 0)."""
    confirming_distance: float = 0.0
    """A robot that was carried away believes that it recognises a place only if it does so again,
    at the same alignment, this far (m) from where it did so first; 0: at once, as in the thesis,
    where a second look is not mentioned. With 4 m goes a probability of 0.8 (docs/places.md)."""
    max_surfaces: int = 1024
    """Maximum number of surfaces in a place's description; those seen last are kept. Without a
    limit, a robot whose map drifts would add each wall again, beside itself, at every return."""
    max_events: int = 512
    """Maximum number of events remembered; the oldest are forgotten first."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "tolerance", "compare_spacing", "compare_turn")
        check_fields(self, NOT_NEGATIVE, "confirming_distance")
        check_fields(
            self, SHARE, "min_share", "reobserved_share", "min_share_here", "min_probability"
        )
        check_fields(self, SHARE, "min_relocalise_probability")
        counts = "min_matches", "min_reobserved", "max_reobserved", "min_relocalise_matches"
        check_fields(self, FROM_ONE, *counts, "max_surfaces", "max_events")

    @classmethod
    def thesis(cls) -> PlacesConfig:
        """Return the thesis's thresholds, which are less strict, although rooms look alike."""
        return cls(
            match=MatchConfig(max_gap=0.40, max_shift=np.inf, max_turn=np.pi),
            takes_first_match=True,
            min_probability=0.0,
            min_share=0.0,
            candidates_by_position=False,
            uses_expected_exits=False,
            aligns_by_exit_seen=True,
            expects_drift=False,
            counts_by_place=True,
            candidates_seen_through_exits=False,
            mends_missed_crossings=False,
            must_stand_within=False,
            keeps_believed_pose=False,
            compares_at_updates=True,
        )


@dataclass(frozen=True, kw_only=True)
class Albot1Config:
    """Thresholds of Albot1. `Albot1Config.thesis()` returns the thesis's, to the letter.

    The defaults differ from the thesis as follows. A surface lies on the line fitted to all its
    points. The robot's position belongs to the boundary of its view. A wall is extended only as far
    as it is straight. The odometer's turn is searched, because in real logs it is often off by more
    than the 5° that recognition allows. All remembered walls nearby localise the robot. Places are
    compared more strictly.
    """

    view: ViewConfig = field(
        default_factory=lambda: ViewConfig(
            bend_significance=10.0,
            fit_lines=True,
            min_incidence=np.radians(10.0),
            cut_ends=True,
            beam_model=True,
        )
    )
    """Parameters of view construction (section 3.1.3). A bent wall that is drawn straight turns the
    robot a little at each update, always the same way, so walls are broken where they are bent: on
    Intel and Wean Hall errors are nearly equal for F statistics of 10 and 20. As in the thesis, an
    occluding point needs another surface that it obstructs: without the ends along one wall
    (`grazing_ends`), the corridor of experiment 3 and ACES come out better (`albot1-readings`)."""
    places: PlacesConfig = field(default_factory=PlacesConfig)
    """Thresholds of the network of places (chapter 4)."""
    remembers_places: bool = True
    """Whether exits are found and places remembered (chapter 4). If off, only chapter 3 is in use:
    no exit is crossed, and none forces an update of the map (algorithm 5, line 16)."""
    view_spacing: float = 0.3
    """A reading is a view if the robot has moved at least this far since the last view (m)…"""
    view_turn: float = np.radians(15.0)
    """…or turned at least this far (rad); any other reading only moves the robot by its odometer.
    With `submap_matching` a reading is also a view where the odometer cannot be trusted
    (`is_view_due`). At 0 every reading is a view.

    The thesis's robots stopped for each view, or, guided in continuous motion, took one every 10 cm
    or 1°, or 1 m or 10° (section 3.1.2). Views 0.3 m or 15° apart leave the errors of position as
    they are, in worlds and on logs, and take less time (`albot bench --part views`).
    """
    landmark_length: float = 0.40
    """Minimum length of a landmark (m; section 3.1.4)."""
    landmark_angle: float = np.radians(5.0)
    """Two surfaces match only if the angle between them is below this (rad; algorithm 1, line
    6)."""
    landmark_gap: float = 0.40
    """Two surfaces match only if their occluding or corner points are nearer than this
    (m; algorithm 1, line 7)."""
    min_landmarks: int = 3
    """With fewer recognised landmarks the limiting point is reached (algorithm 4, line 12)."""
    margin: float = 0.18
    """A point this near to the view's boundary counts as inside (m; algorithm 3, line 9). The
    thesis has 0.40. The less a map drifts, the less of it must be removed with a view, and what
    remains localises the next views. The value is not round and differs from all other thresholds,
    because walls are cut at exactly this distance from the boundary."""
    robot_in_boundary: bool = True
    """Whether the robot's position is a corner of the view's boundary. Off in the thesis: there the
    boundary joins the surfaces' ends alone (algorithm 3, line 7), so that where nothing stands at
    ±90° the ground between the robot and its first and last surface counts as outside."""
    keeps_outer_end: bool = True
    """Whether a remembered surface that a view extends keeps its end outside the view (algorithm 3,
    line 12). If off, the view's surface is extended in its own direction as far as that end: a
    short new surface then rotates a long old wall (`albot experiment run albot1-readings`)."""
    join_height: float = 0.05
    """A remembered surface is joined with the view's surface only where the wall stays straight:
    where the outer end of the view's surface lies no farther than this (m) from the straight line
    between its other end and the remembered outer end. The walls on both sides of an alcove match
    as one wall (within `landmark_gap` and `landmark_angle`); a single surface would lie beside both
    of them, and bias the next views. It has no effect with `keeps_outer_end` off. On Intel and Wean
    Hall errors are nearly equal from 0.03 to 0.10 m. Infinite, thus without effect, in
    `albot1-thesis` and in `albot1-tracked`, which matches no view with the map."""
    covered_is_reobserved: bool = False
    """Whether every surface with one or both ends inside a view, which is about to be removed or
    extended, counts as observed again (section 4.1.2). If off, it counts only if the view holds the
    same wall, within `landmark_gap` and `landmark_angle`. Off in `albot1`, where it changes no
    network of places (`albot1-readings`): there surfaces observed again are counted in matching."""
    submap_matching: bool = True
    """Localise by the local submap: all remembered walls nearby, under the likeliest turn.

    Off in the thesis and in `albot1-tracked`: there landmarks are followed from view to view.
    """
    joint_landmarks: bool = True
    """Whether all landmarks followed localise the robot together, under the likeliest turn
    (`tracking`). Off in the thesis: there the odometer's turn is trusted, and one landmark
    localises the robot. Without effect where `submap_matching` is on."""
    longest_landmark: bool = False
    """Whether the single landmark that localises the robot is the longest, as the text at figure
    3.11 says; otherwise it is that of the highest goodness, eq. (3.5). Without effect where several
    landmarks localise the robot."""
    turn_search: float = np.radians(50.0)
    """Largest error of the odometer's turn that is searched (rad), at most half a turn; with
    `submap_matching` it holds as long as matches are sure."""
    turn_cost: float = np.radians(6.0)
    """Minimum scale of the odometer's turn errors (rad). A turn that differs from the odometer's
    costs by the difference in scales, as in Student's t distribution: an odometer that slips may be
    off by any turn (`range_profile`)."""
    turn_scale: float = 2.5
    """With `submap_matching` the scale is this many times the root mean square of the turn errors
    in recent matches (`odometer_error`): a bad odometer is trusted less."""
    unsure: float = 0.5
    """With `submap_matching` a match is unsure if a smaller share of the walls in view lies on
    expected walls. Then other turns and motions are tried as well, and nothing is learnt about the
    odometer's errors."""
    match_range: float = 25.0
    """Maximum distance of surfaces that are recognised and localise the robot (m)."""
    motion_error: float = 0.05
    """Standard deviation of the odometer's translation between views (m); with `submap_matching`
    the lower bound of it (`odometer_error`)."""
    turn_error: float = np.radians(5.0)
    """Standard deviation of the turn that the search has found (rad)."""
    min_exit_width: float = 0.65
    """Minimum width of an exit (m)."""
    max_exit_width: float = 1.35
    """Maximum width of an exit (m): a doorway is typically about 1 m wide (section 4.1.1)."""

    def __post_init__(self) -> None:
        lengths = "landmark_length", "landmark_gap", "match_range", "motion_error"
        angles = "landmark_angle", "turn_cost", "turn_error", "turn_scale"
        check_fields(self, POSITIVE, *lengths, *angles, "min_exit_width", "max_exit_width")
        check_fields(self, NOT_NEGATIVE, "view_spacing", "view_turn", "margin")
        check_fields(self, _ANGLE, "turn_search")
        check_fields(self, _HEIGHT, "join_height")
        check_fields(self, SHARE, "unsure")
        check_fields(self, FROM_ONE, "min_landmarks")

    @classmethod
    def thesis(cls) -> Albot1Config:
        """Return the thesis's thresholds, to the letter."""
        return cls(
            view=ViewConfig(),
            places=PlacesConfig.thesis(),
            view_spacing=0.0,
            view_turn=0.0,
            margin=0.40,
            robot_in_boundary=False,
            join_height=math.inf,
            covered_is_reobserved=True,
            submap_matching=False,
            joint_landmarks=False,
        )

    @classmethod
    def tracked(cls) -> Albot1Config:
        """Return the thresholds of `albot1-tracked`, which localises by all tracked landmarks."""
        return cls(
            view=ViewConfig(fit_lines=True, grazing_ends=True),
            places=PlacesConfig(
                min_probability=0.0,
                expects_drift=False,
                keeps_believed_pose=False,
                compares_at_updates=True,
            ),
            view_spacing=0.0,
            view_turn=0.0,
            margin=0.40,
            join_height=math.inf,
            submap_matching=False,
            covered_is_reobserved=True,
            turn_cost=np.radians(12.0),
        )

    @property
    def limits(self) -> Albot1Limits:
        """The thresholds that the compiled steps take."""
        return Albot1Limits(*(getattr(self, name) for name in Albot1Limits._fields))

    @property
    def landmark_cosine(self) -> float:
        """The cosine of `landmark_angle`; -2, below every cosine, where all angles are allowed."""
        return math.cos(self.landmark_angle) if self.landmark_angle < math.pi else -2.0

    @property
    def compare_spacing(self) -> float:
        """The distance that the robot moves between two comparisons of places (m)."""
        return self.places.compare_spacing

    @property
    def compare_turn(self) -> float:
        """The angle that the robot turns between two comparisons of places (rad)."""
        return self.places.compare_turn

    @property
    def compares_at_updates(self) -> bool:
        """Whether places are compared at updates of the map, and only then."""
        return self.places.compares_at_updates
