"""Every threshold of Albot1. The defaults are those of `albot1`; `thesis()` those of the thesis."""

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
    """`Albot1Config` as compiled code takes it (m, rad)."""

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
    turn_cost: float
    turn_scale: float
    unsure: float
    turn_search: float


@dataclass(frozen=True, kw_only=True)
class PlacesConfig:
    """Thresholds of the network of places (chapter 4)."""

    match: MatchConfig = field(default_factory=MatchConfig)
    """When surfaces, and places, are the same (section 4.1.2). The thesis's surfaces may be 0.40 m
    apart; it does not limit where a place may be found."""
    min_matches: int = 4
    """More surfaces must be the same (algorithm 6, line 11)…"""
    min_probability: float = 0.93
    """…and it must be so probable that the places are one (`places/evidence.py`). At 0, as in
    `albot1-thesis` and `albot1-tracked`, that is not asked, but the next shares are."""
    min_share: float = 0.3
    """The same surfaces must make up this share of the smaller description (thesis: any)."""
    reobserved_share: float = 0.1
    """A place is a loop-closure candidate if more surfaces are observed again than its gate says:
    this share of all its surfaces…"""
    min_reobserved: int = 2
    """…but no fewer than this…"""
    max_reobserved: int = 8
    """…and no more than this. The thesis says only that n grows with the place's size."""
    candidates_by_position: bool = True
    """When the robot enters a new place, those within whose surfaces it believes to stand are
    candidates as well. Off in the thesis."""
    min_share_here: float = 0.7
    """There the same surfaces must make up this share of the smaller description, where the
    probability is not asked."""
    expects_drift: bool = True
    """Whether the map may have drifted. The distance at which a known exit or place is accepted
    grows with the way since the map was last aligned. The robot may have entered the next room
    unnoticed. Off in `albot1-thesis` and `albot1-tracked`."""
    compare_spacing: float = 0.7
    """Places are compared again after the robot has gone so far (m)…"""
    compare_turn: float = np.radians(45.0)
    """…or turned so far (rad)."""
    uses_expected_exits: bool = True
    """Known exits are crossed where they are expected, though they are not seen. Off in the
    thesis."""
    tolerance: float = 0.40
    """Where map and alignment differ by less (m), the map is left as it is."""
    min_relocalise_matches: int = 7
    """A robot that was carried away recognises a place by at least so many surfaces; and it must be
    so probable that it is there as `min_probability` says (`places/hypothesis.py`)."""
    max_surfaces: int = 1024
    """Surfaces of a place's description; those seen last are kept. Without a
    limit, a robot that drifts as it comes back would describe each wall again beside itself."""
    max_events: int = 512
    """Events remembered; the oldest are forgotten first."""

    def __post_init__(self) -> None:
        check_fields(self, POSITIVE, "tolerance", "compare_spacing", "compare_turn")
        check_fields(
            self, SHARE, "min_share", "reobserved_share", "min_share_here", "min_probability"
        )
        counts = "min_matches", "min_reobserved", "max_reobserved", "min_relocalise_matches"
        check_fields(self, FROM_ONE, *counts, "max_surfaces", "max_events")

    @classmethod
    def thesis(cls) -> PlacesConfig:
        """The thesis's thresholds. They ask for less, though rooms are alike."""
        return cls(
            match=MatchConfig(max_gap=0.40, max_shift=np.inf, max_turn=np.pi),
            min_probability=0.0,
            min_share=0.0,
            candidates_by_position=False,
            uses_expected_exits=False,
            expects_drift=False,
        )


@dataclass(frozen=True, kw_only=True)
class Albot1Config:
    """Thresholds of Albot1. `Albot1Config.thesis()` are the thesis's, to the letter.

    The defaults depart from it in these ways. Surfaces lie on the line of all their points. The
    robot's own place belongs to the boundary of its view. Walls are extended only as far as they
    are straight. The odometer's turn is searched anew, because in real logs it is often off by more
    than the 5° that recognition allows. All that is remembered nearby localises the robot. Places
    are compared more strictly.
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
    Intel and Wean Hall errors are nearly alike for F statistics of 10 and 20. An occluding point
    obstructs another surface, as in the thesis: without such ends along one wall (`grazing_ends`)
    the corridor of experiment 3 and ACES come out better (`albot1-readings`)."""
    places: PlacesConfig = field(default_factory=PlacesConfig)
    """Thresholds of the network of places (chapter 4)."""
    remembers_places: bool = True
    """Whether exits are found and places remembered (chapter 4). Without, chapter 3 stands alone:
    no exit is crossed, and none forces an update of the map (algorithm 5, line 16)."""
    view_spacing: float = 0.3
    """A reading is a view only from this far from the last view's place on (m)…"""
    view_turn: float = np.radians(15.0)
    """…or from this large a turn since on (rad); one nearer than both only moves the robot, as the
    odometer says. With `submap_matching` one is also a view where the odometer cannot be believed
    (`is_view_due`). At 0 every reading is a view.

    The thesis's robots stopped for each view, or, guided in continuous motion, took one every 10 cm
    or 1°, or 1 m or 10° (section 3.1.2). Views 0.3 m or 15° apart leave the errors of position as
    they are, in worlds and on logs, and take less time (`albot bench --part views`).
    """
    landmark_length: float = 0.40
    """Shorter surfaces are no landmarks (m; section 3.1.4)."""
    landmark_angle: float = np.radians(5.0)
    """Two surfaces are taken for one only below this angle (rad; algorithm 1, line 6)."""
    landmark_gap: float = 0.40
    """Two surfaces are taken for one only where their occluding or corner points are nearer
    than this (m; algorithm 1, line 7)."""
    min_landmarks: int = 3
    """With fewer recognised landmarks the limiting point is reached (algorithm 4, line 12)."""
    margin: float = 0.18
    """What lies this near to the view's boundary counts as inside (m; algorithm 3, line 9). The
    thesis's is 0.40. The less a map drifts, the less has to go with what a view covers, and what
    stays holds the next views. It is no round length, and no other threshold, for walls are cut
    exactly so far from the boundary."""
    robot_in_boundary: bool = True
    """The robot's own place is a corner of the view's boundary. Off in the thesis: there the
    boundary joins the surfaces' ends alone (algorithm 3, line 7), so that where nothing stands at
    ±90° the ground between the robot and its first and last surface counts as outside."""
    keeps_outer_end: bool = True
    """A remembered surface that a view extends keeps its end outside the view (algorithm 3,
    line 12). Off, the view's surface is drawn out, in its own direction, as far as that end: a
    short new surface swings a long old wall about (`albot experiment run albot1-readings`)."""
    join_height: float = 0.05
    """A remembered surface is drawn together with the view's only where the wall stays straight:
    where the outer end of the view's surface lies no farther than this (m) from the straight line
    between its other end and the remembered outer end. The walls on both sides of an alcove pass as
    one wall (within `landmark_gap` and `landmark_angle`); a single surface would lie beside both of
    them, and pull the next views along. It has no effect with `keeps_outer_end` off. On Intel and
    Wean Hall errors are nearly alike from 0.03 to 0.10 m. Infinite, so without effect, in
    `albot1-thesis`, and in `albot1-tracked`, which matches nothing with walls in the map."""
    covered_is_reobserved: bool = False
    """Every surface that a view covers, at one end or both, counts as met again (section 4.1.2):
    those about to be deleted or extended. Off, only one that the view holds too, within
    `landmark_gap` and `landmark_angle`. Off in `albot1`, where it changes no network of places
    (`albot1-readings`): what is met again is counted as it is matched."""
    submap_matching: bool = True
    """Localise by the local submap: all that is remembered nearby, under the likeliest turn.

    Off in the thesis and in `albot1-tracked`: there landmarks are followed from view to view.
    """
    joint_landmarks: bool = True
    """All landmarks followed localise the robot together, under the likeliest turn (`tracking`).
    Off in the thesis: there the odometer's turn is believed, and one landmark localises the robot.
    Of no account where `submap_matching` is on."""
    longest_landmark: bool = False
    """The one landmark is the longest, as the text at figure 3.11 says; otherwise that of the
    highest goodness, eq. (3.5). Matters only where one landmark localises the robot."""
    turn_search: float = np.radians(50.0)
    """Largest error of the odometer's turn that is searched (rad), up to half a turn; with
    `submap_matching` as long as a match is sure."""
    turn_cost: float = np.radians(6.0)
    """Least scale of the odometer's errors of turn (rad). A turn that differs from the odometer's
    costs by the difference in scales, as Student's t has it: an odometer that slips may be off by
    any turn (`range_profile`)."""
    turn_scale: float = 2.5
    """With `submap_matching` the scale is so many times the errors of turn that the matches of late
    have shown, root mean square (`odometer_error`): a bad odometer is believed less."""
    unsure: float = 0.5
    """With `submap_matching` a match is unsure where a smaller share of what is in view lies on
    what is expected there. Then other turns and motions are tried as well, and nothing is learnt of
    the odometer's errors."""
    match_range: float = 25.0
    """Only surfaces nearer than this are recognised and localise the robot (m)."""
    motion_error: float = 0.05
    """Standard deviation of the odometer's translation between views (m); with `submap_matching`
    the least one (`odometer_error`)."""
    turn_error: float = np.radians(5.0)
    """Standard deviation of the turn that the search has found (rad)."""
    min_exit_width: float = 0.65
    """Narrower gaps are no exits (m)…"""
    max_exit_width: float = 1.35
    """…nor are wider ones (m): a doorway's typical size is about 1 m (section 4.1.1)."""

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
        """The thesis's thresholds, to the letter."""
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
        """Those of `albot1-tracked`: landmarks followed from view to view localise it jointly."""
        return cls(
            view=ViewConfig(fit_lines=True, grazing_ends=True),
            places=PlacesConfig(min_probability=0.0, expects_drift=False),
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
        """The thresholds as the compiled steps take them."""
        return Albot1Limits(*(getattr(self, name) for name in Albot1Limits._fields))

    @property
    def landmark_cosine(self) -> float:
        """The cosine of `landmark_angle`; below that of any angle where all are allowed."""
        return math.cos(self.landmark_angle) if self.landmark_angle < math.pi else -2.0

    @property
    def compare_spacing(self) -> float:
        """How far the robot goes from one comparison of places to the next (m)."""
        return self.places.compare_spacing

    @property
    def compare_turn(self) -> float:
        """How far it turns (rad)."""
        return self.places.compare_turn
