from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from albot_core.errors import InputError
from albot_core.evaluation.relations import Relations, read_relations, relation_error
from albot_core.evaluation.trajectory import Trajectory
from albot_core.geometry.poses import compose, relative

POSES = hnp.arrays(np.float64, (6, 3), elements=st.floats(-50, 50, allow_subnormal=False))
POSE = hnp.arrays(np.float64, 3, elements=st.floats(-3, 3, allow_subnormal=False))


def trajectory(poses: np.ndarray) -> Trajectory:
    return Trajectory(stamps=np.arange(len(poses), dtype=np.float64), poses=poses)


def relations_of(poses: np.ndarray, pairs: list[tuple[int, int]]) -> Relations:
    first, second = np.array(pairs).T
    return Relations(
        stamps=np.array(pairs, np.float64), poses=relative(poses[first], poses[second])
    )


PAIRS = [(0, 1), (1, 2), (4, 2), (0, 5), (3, 3)]


@settings(deadline=None)
@given(poses=POSES, frame=POSE)
def test_the_truth_in_any_frame_has_no_error(poses, frame):
    error = relation_error(trajectory(compose(frame, poses)), relations_of(poses, PAIRS))
    assert error is not None
    assert error.count == len(PAIRS)
    assert error.translation_mean < 1e-9
    assert error.rotation_mean < 1e-9


@settings(deadline=None)
@given(poses=POSES, frame=POSE)
def test_the_error_knows_no_frame(poses, frame):
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
        ("1 2 0 0 0 0 0 north", "line 1: .*'north'"),
        ("", "at least one relation"),
        ("# nothing\n", "at least one relation"),
    ],
)
def test_damaged_relations_are_named(text, message, tmp_path):
    path = tmp_path / "run.relations"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_relations(path)
