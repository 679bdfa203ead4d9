"""Arithmetic of networks against plain Python's, against libm's, and on other processors."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy._core._multiarray_umath import __cpu_dispatch__

from albot_agents.trained import network_kernels
from albot_agents.trained.network_kernels import (
    exponential,
    hyperbolic_tangent,
    multiply,
    softmax,
)

ANSWERS = """
import hashlib
import numpy as np
from albot_agents.trained.agent_file import read_agent
from albot_agents.trained.network import Network
from albot_agents.trained.trained_agent import shipped_agents

digest = hashlib.sha256()
for path in shipped_agents().values():
    file, rng = read_agent(path), np.random.default_rng(6)
    network = Network(file.network, file.weights)
    for _ in range(20):
        answer = network(rng.uniform(-1, 1, file.network.inputs).astype(np.float32))
        digest.update(answer.tobytes())
        if file.network.sampled:
            digest.update(network.sample(answer, rng).tobytes())
print(digest.hexdigest())
"""
OTHER_PROCESSOR = {
    "OPENBLAS_CORETYPE": "Prescott",
    "NPY_DISABLE_CPU_FEATURES": " ".join(__cpu_dispatch__),
    "NUMBA_CPU_NAME": "x86-64",
    "NUMBA_CPU_FEATURES": "",
}
"""Settings by which this processor computes as one without AVX and without fused products."""


@pytest.mark.skipif(sys.platform != "linux" or os.uname().machine != "x86_64", reason="x86 only")
def test_agents_act_alike_on_other_processors() -> None:
    answers = {
        subprocess.run(
            [sys.executable, "-c", ANSWERS],
            env=os.environ | settings,
            capture_output=True,
            check=True,
            text=True,
        ).stdout
        for settings in ({}, OTHER_PROCESSOR)
    }
    assert len(answers) == 1
    assert len(answers.pop().strip()) == 64


def test_products_are_added_up_in_order() -> None:
    rng = np.random.default_rng(1)
    rows = rng.normal(size=(3, 700)).astype(np.float32)
    columns = rng.normal(size=(700, 5)).astype(np.float32)
    rows[:, rng.random(700) < 0.3] = 0.0
    found = multiply(rows, columns)
    for row in range(3):
        for column in range(5):
            total = 0.0
            for term in range(700):
                total += float(rows[row, term]) * float(columns[term, column])
            assert found[row, column] == np.float32(total)


@given(st.lists(st.floats(-200, 200, width=32), min_size=1, max_size=20))
def test_functions_are_those_of_libm(values: list[float]) -> None:
    row = np.array(values, np.float32)
    wide = np.clip(row.astype(np.float64), -150, 150)
    with np.errstate(over="ignore", under="ignore"):
        expected = np.exp(wide).astype(np.float32)
    np.testing.assert_allclose(exponential(row), expected, rtol=2e-7, atol=1e-44)
    np.testing.assert_allclose(hyperbolic_tangent(row), np.tanh(wide), rtol=0, atol=6e-8)


def test_what_is_no_number_stays_so() -> None:
    """It must not become an index: weights in a file may be so large that they overflow."""
    plain = network_kernels._exponential.py_func  # type: ignore[attr-defined]
    assert np.isnan(plain(np.nan))  # Python would refuse the index; compiled code reads elsewhere.
    row = np.array([np.nan, np.inf, -np.inf], np.float32)
    np.testing.assert_array_equal(exponential(row), [np.nan, np.inf, 0.0])
    np.testing.assert_array_equal(hyperbolic_tangent(row), [np.nan, 1.0, -1.0])
    assert np.isnan(softmax(row[np.newaxis])).all()


def test_functions_are_those_of_plain_python_to_the_last_bit() -> None:
    """So nothing is fused, and no sum is reordered."""
    plain = network_kernels._exponential.py_func  # type: ignore[attr-defined]
    rows = np.random.default_rng(2).normal(0.0, 20.0, (30, 50)).astype(np.float32)
    powers = np.array([np.float32(plain(float(value))) for value in rows.flat])
    np.testing.assert_array_equal(exponential(rows).ravel(), powers)
    shares = softmax(rows)
    for row, found in zip(rows, shares, strict=True):
        each = np.array([plain(float(score) - float(row.max())) for score in row])
        expected = (each / sum(each.tolist())).astype(np.float32)
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-6)
