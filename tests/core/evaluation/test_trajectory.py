"""Errors of trajectories, in closed form and by laws."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from albot_core.errors import InputError
from albot_core.evaluation.moments import associate
from albot_core.evaluation.trajectory import (
    Relations,
    Trajectory,
    align,
    alignment_at_start,
    path_length,
    read_relations,
    relation_error,
    relative_errors,
    trajectory_error,
)
from albot_core.geometry.poses import compose, relative, transform_points

COORDINATE = st.floats(-100, 100, allow_subnormal=False)
POSE = hnp.arrays(np.float64, 3, elements=st.floats(-10, 10, allow_subnormal=False))
POSES = st.integers(3, 12).flatmap(lambda n: hnp.arrays(np.float64, (n, 3), elements=COORDINATE))


def trajectory(poses: np.ndarray, first: float = 0.0) -> Trajectory:
    return Trajectory(stamps=first + np.arange(len(poses), dtype=np.float64), poses=poses)


def error(estimate: Trajectory, reference: Trajectory) -> float:
    measured = trajectory_error(estimate, reference)
    assert measured is not None
    return measured.rmse


def test_a_square_with_one_side_out():
    # By symmetry the best alignment of (0, 0), (2, 0) on (0, 0), (4, 0) sets the middles on
    # each other, so both ends are 1 m off.
    mine = np.array([[0.0, 0, 0], [2, 0, 0]])
    theirs = np.array([[0.0, 0, 0], [4, 0, 0]])
    measured = trajectory_error(trajectory(mine), trajectory(theirs))
    assert measured is not None
    assert (measured.count, measured.rmse, measured.mean, measured.median, measured.largest) == (
        2,
        pytest.approx(1),
        pytest.approx(1),
        pytest.approx(1),
        pytest.approx(1),
    )


def test_the_errors_of_a_straight_way_that_is_a_tenth_too_long():
    # Every motion of 1 m is told as 1.1 m, whatever the error so far; and it turns by 2° each.
    along = np.arange(0.0, 10.01, 0.5)
    truth = np.column_stack((along, np.zeros((len(along), 2))))
    mine = np.column_stack((1.1 * along, np.zeros(len(along)), np.deg2rad(2) * along))
    found = relative_errors(trajectory(mine), trajectory(truth))
    assert found is not None
    assert found.paths == pytest.approx(np.arange(1.0, 10.5))
    assert found.rotations == pytest.approx(np.full(10, np.deg2rad(2)))
    # The motion is told in the frame of a robot that has turned: a chord of the circle.
    turned = np.deg2rad(2) * np.arange(10.0)
    assert found.translations == pytest.approx(
        np.hypot(1.1 * np.cos(turned) - 1, 1.1 * np.sin(turned))
    )


def test_too_short_a_way_has_no_errors_by_the_metre():
    truth = np.column_stack((np.linspace(0, 0.9, 5), np.zeros((5, 2))))
    assert relative_errors(trajectory(truth), trajectory(truth)) is None
    assert relative_errors(trajectory(truth), trajectory(truth), delta=0.4) is not None


@given(st.integers(0, 10_000), POSE)
def test_errors_by_the_metre_depend_on_no_frame_and_are_those_of_evo(seed, frame):
    generator = np.random.default_rng(seed)
    truth = np.cumsum(generator.normal(0, 0.5, (30, 3)), axis=0)
    mine = truth + generator.normal(0, 0.1, (30, 3))
    found = relative_errors(trajectory(mine), trajectory(truth))
    moved = relative_errors(trajectory(compose(frame, mine)), trajectory(truth))
    assert found is not None
    assert moved is not None
    assert moved.translations == pytest.approx(found.translations)
    assert moved.rotations == pytest.approx(found.rotations, abs=1e-7)
    # As evo 1.38 pairs poses and takes errors, with matrices.
    ends, way = [0], 0.0
    for k in range(1, len(truth)):
        way += np.linalg.norm(truth[k, :2] - truth[k - 1, :2])
        if way >= 1.0:
            ends.append(k)
            way = 0.0
    expected = []
    for i, j in itertools.pairwise(ends):
        motion = [np.linalg.inv(matrix(some[i])) @ matrix(some[j]) for some in (truth, mine)]
        expected.append(np.linalg.norm((np.linalg.inv(motion[0]) @ motion[1])[:2, 2]))
    assert found.translations == pytest.approx(np.array(expected))


def matrix(pose: np.ndarray) -> np.ndarray:
    cosine, sine = np.cos(pose[2]), np.sin(pose[2])
    return np.array(((cosine, -sine, pose[0]), (sine, cosine, pose[1]), (0.0, 0.0, 1.0)))


def test_one_point_out_of_line():
    # Four points of a square, one pushed out along its diagonal by d: least squares leaves
    # d² (1 - 1/4 - 1/8): the shift takes a quarter of it, and the push is radial, so no turn
    # takes any.
    square = np.array([[1.0, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
    pushed = square.copy()
    pushed[0, :2] += 0.4 / np.sqrt(2)
    measured = trajectory_error(trajectory(pushed), trajectory(square))
    assert measured is not None
    assert measured.rmse == pytest.approx(np.sqrt(0.4**2 * (3 / 4) / 4))


@settings(deadline=None)
@given(poses=POSES, other=POSES, frame=POSE)
def test_the_error_knows_no_frame(poses, other, frame):
    count = min(len(poses), len(other))
    mine, theirs = poses[:count], other[:count]
    plain = error(trajectory(mine), trajectory(theirs))
    moved = error(trajectory(compose(frame, mine)), trajectory(theirs))
    assert moved == pytest.approx(plain, abs=1e-6)
    assert error(trajectory(theirs), trajectory(mine)) == pytest.approx(plain, abs=1e-6)


@settings(deadline=None)
@given(poses=POSES, frame=POSE)
def test_the_moved_truth_has_no_error(poses, frame):
    assert error(trajectory(compose(frame, poses)), trajectory(poses)) < 1e-9


@settings(deadline=None)
@given(poses=POSES, frame=POSE, nudge=POSE)
def test_no_other_frame_is_better(poses, frame, nudge):
    rng = np.random.default_rng(0)
    points = poses[:, :2]
    targets = transform_points(frame, points) + rng.normal(0, 1, points.shape)
    best = align(points, targets)

    def cost(pose: np.ndarray) -> float:
        return float(((transform_points(pose, points) - targets) ** 2).sum())

    assert cost(best) <= cost(best + 0.01 * nudge) + 1e-6


@settings(deadline=None)
@given(poses=POSES)
def test_scale_is_not_taken_out(poses):
    spread = float(np.sqrt(((poses[:, :2] - poses[:, :2].mean(axis=0)) ** 2).sum(axis=1).mean()))
    doubled = poses * (2, 2, 1)
    assert error(trajectory(doubled), trajectory(poses)) == pytest.approx(spread, abs=1e-6)


def test_a_mirror_image_does_not_fit():
    triangle = np.array([[0.0, 0, 0], [4, 0, 0], [0, 2, 0]])
    assert error(trajectory(triangle * (1, -1, 1)), trajectory(triangle)) > 0.5


def test_the_frames_joined_where_both_begin():
    """An odometer that is 10 % short on a straight way errs by all that it lost on the way."""
    stamps = np.arange(5.0)
    truth = np.stack((np.full(5, 2.0), stamps, np.full(5, np.pi / 2)), axis=-1)
    believed = np.stack((0.9 * stamps, np.zeros(5), np.zeros(5)), axis=-1)
    mine = Trajectory(stamps=stamps + 1.0, poses=believed)
    theirs = Trajectory(stamps=stamps + 1.0, poses=truth)
    joined = trajectory_error(mine, theirs, align=alignment_at_start)
    assert joined.rmse == pytest.approx(0.1 * np.sqrt(np.mean(stamps**2)))
    assert trajectory_error(mine, theirs).rmse == pytest.approx(0.1 * np.std(stamps))
    later = Trajectory(stamps=stamps + 100.0, poses=truth)
    assert trajectory_error(mine, later, align=alignment_at_start) is None


def test_the_first_common_moment_joins_the_frames():
    """What came before the reference began, and a reference from before the robot set out."""
    moments = np.arange(10.0)
    truth = np.stack((3 + moments, 0.1 * moments**2, 0.3 * moments), axis=-1)
    frame = np.array((4.0, -1.0, 2.0))
    believed = np.array([relative(frame, pose) for pose in truth])
    off = believed + np.array((0.5, 0.0, 0.4))  # It was elsewhere, and looked elsewhere, before…
    for early, late in ((4, 0), (0, 4)):
        given = believed.copy()
        given[:early] = off[:early]
        mine = Trajectory(stamps=moments[late:], poses=given[late:])
        theirs = Trajectory(stamps=moments[early:], poses=truth[early:])
        np.testing.assert_allclose(alignment_at_start(mine, theirs), frame, atol=1e-9)
        assert trajectory_error(mine, theirs, align=alignment_at_start).rmse < 1e-9


def test_moments_are_paired_by_stamp():
    poses = np.array([[0.0, 0, 0], [1, 0, 0], [2, 5, 0], [3, 0, 0]])
    mine = Trajectory(stamps=np.array([0.0, 1.004, 2.5, 3.0]), poses=poses)
    theirs = trajectory(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]]))
    measured = trajectory_error(mine, theirs)
    assert measured is not None
    assert measured.count == 3
    assert measured.rmse == pytest.approx(0, abs=1e-9)
    # Paired by place, the third pose would count.
    assert error(trajectory(poses), theirs) > 1


def test_trajectories_without_common_moments_have_no_error():
    poses = np.zeros((3, 3))
    assert trajectory_error(trajectory(poses), trajectory(poses, first=100.0)) is None
    assert trajectory_error(trajectory(poses[:0]), trajectory(poses)) is None
    assert trajectory_error(trajectory(poses), trajectory(poses[:0])) is None


STAMPS = st.lists(st.integers(0, 10 * 64), max_size=12)
SORTED = STAMPS.map(lambda stamps: np.array(sorted(stamps)) / 64)
"""In steps of 1/64 s, so that differences are exact."""


@settings(deadline=None)
@given(stamps=SORTED, wanted=SORTED, tolerance=st.floats(0, 2))
def test_association_is_the_nearest_stamp(stamps, wanted, tolerance):
    mine, theirs = associate(stamps, wanted, tolerance)
    found = dict(zip(theirs.tolist(), mine.tolist(), strict=True))
    for k, stamp in enumerate(wanted):
        gaps = np.abs(stamps - stamp)
        nearest = stamps[gaps == gaps.min()][:1] if len(gaps) else stamps
        alone = (wanted == stamp).sum() == 1 and (stamps == nearest).sum() == 1
        if alone and gaps.min() <= tolerance:
            assert gaps[found[k]] == gaps.min()
        else:
            assert k not in found


def test_path_length():
    poses = np.array([[0.0, 0, 0], [3, 4, 1], [3, 4, 2], [3, 3, 0]])
    assert path_length(poses) == pytest.approx(6)
    assert path_length(poses[:1]) == 0


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        ([0.0, np.nan, 1.0], "finite numbers"),
    ],
)
def test_what_is_no_trajectory(stamps, message):
    with pytest.raises(InputError, match=message):
        Trajectory(stamps=np.array(stamps), poses=np.zeros((3, 3)))


SIX_POSES = hnp.arrays(np.float64, (6, 3), elements=st.floats(-50, 50, allow_subnormal=False))
FRAME = hnp.arrays(np.float64, 3, elements=st.floats(-3, 3, allow_subnormal=False))


def relations_of(poses: np.ndarray, pairs: list[tuple[int, int]]) -> Relations:
    first, second = np.array(pairs).T
    return Relations(
        stamps=np.array(pairs, np.float64), poses=relative(poses[first], poses[second])
    )


PAIRS = [(0, 1), (1, 2), (4, 2), (0, 5), (3, 3)]


@settings(deadline=None)
@given(poses=SIX_POSES, frame=FRAME)
def test_the_truth_in_any_frame_has_no_error(poses, frame):
    error = relation_error(trajectory(compose(frame, poses)), relations_of(poses, PAIRS))
    assert error is not None
    assert error.count == len(PAIRS)
    assert error.translation_mean < 1e-9
    assert error.rotation_mean < 1e-9


@settings(deadline=None)
@given(poses=SIX_POSES, frame=FRAME)
def test_the_relation_error_knows_no_frame(poses, frame):
    truth = relations_of(np.roll(poses, 1, axis=0), PAIRS)
    one = relation_error(trajectory(poses), truth)
    other = relation_error(trajectory(compose(frame, poses)), truth)
    assert one is not None
    assert other is not None
    assert one.translation_mean == pytest.approx(other.translation_mean, abs=1e-9)
    assert np.cos(one.rotation_mean) == pytest.approx(np.cos(other.rotation_mean), abs=1e-6)


def test_known_errors():
    # One relation too long by 1 m, one turned by 0.3 rad and shifted by 3 m, one true.
    poses = np.array([[0.0, 0, 0], [2, 0, 0], [2, 0, np.pi / 2], [2, 1, np.pi / 2]])
    truth = Relations(
        stamps=np.array([[0.0, 1], [1, 2], [2, 3]]),
        poses=np.array([[1.0, 0, 0], [0, 3, np.pi / 2 - 0.3], [1, 0, 0]]),
    )
    error = relation_error(trajectory(poses), truth)
    assert error is not None
    assert error.count == 3
    assert error.translation_mean == pytest.approx(4 / 3)
    assert error.translation_std == pytest.approx(np.std([1, 3, 0]))
    assert error.rotation_mean == pytest.approx(0.1)
    assert error.rotation_std == pytest.approx(np.std([0, 0.3, 0]))


def test_angles_are_compared_the_short_way():
    poses = np.array([[0.0, 0, 0], [0, 0, 3.1]])
    truth = Relations(stamps=np.array([[0.0, 1]]), poses=np.array([[0.0, 0, -3.1]]))
    error = relation_error(trajectory(poses), truth)
    assert error is not None
    assert error.rotation_mean == pytest.approx(2 * np.pi - 6.2)


def test_relations_of_other_moments_are_not_counted():
    poses = np.zeros((3, 3))
    truth = Relations(stamps=np.array([[0.0, 1], [1, 7], [0.004, 2]]), poses=np.zeros((3, 3)))
    error = relation_error(trajectory(poses), truth)
    assert error is not None
    assert error.count == 1
    wider = relation_error(trajectory(poses), truth, tolerance=0.01)
    assert wider is not None
    assert wider.count == 2
    none = Relations(stamps=np.array([[10.0, 11]]), poses=np.zeros((1, 3)))
    assert relation_error(trajectory(poses), none) is None


def test_a_moment_is_not_related_to_itself(tmp_path):
    path = tmp_path / "run.relations"
    path.write_text("1 2 0 0 0 0 0 0\n3 3.0 0 0 0 0 0 0\n")
    with pytest.raises(InputError, match=r"line 2: expected two moments, found 3 twice$"):
        read_relations(path)


def test_reading_relations(tmp_path):
    path = tmp_path / "run.relations"
    path.write_text("# a comment\n\n1.5 2.5 0.1 -0.2 9 8 7 0.3\n2.5 1.5 1 2 0 0 0 -3\n")
    relations = read_relations(path)
    assert relations.stamps.tolist() == [[1.5, 2.5], [2.5, 1.5]]
    assert relations.poses.tolist() == [[0.1, -0.2, 0.3], [1, 2, -3]]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1 2 0 0 0 0 0 0\n1 2 0 0 0 0", "line 2: expected eight finite numbers.*found 6 fields"),
        ("1 2 0 0 0 0 0 nan", "line 1: expected eight finite numbers.*NaN"),
        ("1 2 0 0 0 0 0 north", "line 1: expected .*, found 'north'"),
        ("", "at least one relation"),
        ("# nothing\n", "at least one relation"),
    ],
)
def test_damaged_relations_are_named(text, message, tmp_path):
    path = tmp_path / "run.relations"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_relations(path)
