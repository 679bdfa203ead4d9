"""`albot map` on real logs."""

from __future__ import annotations

import lzma

import numpy as np
import pytest

from albot_core.geometry.poses import compose, relative
from tests.cli.conftest import FILES, PLACES, figures
from tests.core.mappers.slam.rooms import LASER, scan_from


@pytest.mark.parametrize(
    ("name", "odometry", "limit"),
    [
        ("intel_raw.json.gz", 24.0, 4.0),
        ("aces-corrected.log.gz", 5.4, 5.0),
        ("freiburg-101-corrected.log.gz", 8.6, 2.0),
    ],
)
def test_albot1_betters_the_odometer_on_real_logs(name, odometry, limit, call, data):
    logs = data / "logs"
    intel = [
        "--reference",
        logs / "intel_reference.json.gz",
        "--relations",
        logs / "intel.relations",
    ]
    found = figures(call("map", logs / name, *(intel if "intel" in name else []), "--json"))
    assert found["odometry_ate_rmse_m"] == pytest.approx(odometry, abs=0.1)
    assert found["ate_rmse_m"] < limit
    if "intel" in name:
        assert found["relations"]["count"] == 90
        assert found["relations"]["translation_mean_m"] < 1.0


@pytest.mark.parametrize(
    ("name", "limit"), [("intel_raw.json.gz", 0.4), ("freiburg-101-corrected.log.gz", 0.25)]
)
def test_fastslam_closes_the_loops_of_real_logs(name, limit, call, data):
    logs = data / "logs"
    reference = ["--reference", logs / "intel_reference.json.gz"] if "intel" in name else []
    found = figures(call("map", logs / name, "--mapper", "fastslam", *reference, "--json"))
    assert found["ate_rmse_m"] < limit
    assert found["odometry_ate_rmse_m"] > 8.0


@pytest.mark.parametrize(
    ("name", "scans"),
    [("wean_robotdata1.log.xz", 713), ("wean_robotdata2.log.xz", 2251), ("duke_loop5.log.xz", 551)],
)
def test_raw_logs_without_a_reference(name, scans, call, data, tmp_path):
    found = figures(call("map", data / "logs" / name, "--out", tmp_path / "out", "--json"))
    assert found["scans"] == scans
    assert found["ate_rmse_m"] is None
    assert found["map_entropy"] < found["odometry_map_entropy"] - 0.1
    assert {path.name for path in (tmp_path / "out").iterdir()} == FILES | PLACES


def test_a_log_without_odometry_is_mapped_by_the_scans_alone(call, data, tmp_path):
    packed = data / "logs" / "wean_robotdata1.log.xz"
    lines = lzma.decompress(packed.read_bytes()).decode().splitlines()
    # O x y theta time; L x y theta, the laser's pose, 180 ranges and the time.
    still = [
        " ".join([words[0], "0", "0", "0", *words[4:]])
        if (words := line.split()) and words[0] == "O"
        else " ".join([words[0], *("0",) * 6, *words[7:]])
        if words and words[0] == "L"
        else line
        for line in lines[:400]
    ]
    log = tmp_path / "still.log"
    log.write_text("\n".join(still) + "\n")
    done = call("map", log, "--json")
    assert figures(done)["notes"][0].startswith("the log's odometry is constant")
    assert "the log's odometry is constant" in done.stderr


@pytest.fixture
def reset_log(tmp_path):
    """A robot turns about in a room; at its scan 31 a driver starts again and counts from zero."""
    poses = [np.array((-1.5, -1.5, 0.2))]
    for _ in range(59):
        poses.append(compose(poses[-1], np.array((0.12, 0.0, 0.05))))
    scans, truth = [], []
    for k, pose in enumerate(poses):
        found = compose(np.array((3.0, -8.0, 1.0)), pose) if k < 30 else relative(poses[30], pose)
        ranges = " ".join(f"{r:.3f}" for r in scan_from(pose).ranges)
        where = " ".join(f"{number:.6f}" for number in (*found, *found))
        scans.append(f"FLASER {LASER.beams} {ranges} {where} {0.2 * k:.6f} robot {0.2 * k:.6f}")
        x, y, heading = pose
        half = f"{np.sin(heading / 2):.9f} {np.cos(heading / 2):.9f}"
        truth.append(f"{0.2 * k:.6f} {x:.6f} {y:.6f} 0 0 0 {half}")
    (tmp_path / "reset.log").write_text("\n".join(scans) + "\n")
    (tmp_path / "truth.tum").write_text("\n".join(truth) + "\n")
    return tmp_path / "reset.log", "--reference", tmp_path / "truth.tum"


@pytest.mark.parametrize("mapper", ["albot1", "association", "odometry", "scan-matching"])
def test_a_reset_of_the_odometer_is_told_and_costs_nothing(mapper, reset_log, call):
    done = call("map", *reset_log, "--mapper", mapper, "--json")
    found = figures(done)
    (note,) = found["notes"]
    assert note.startswith("at scan 31 the odometer jumps by ")
    assert note in done.stderr
    assert found["ate_rmse_m"] < 0.1 < 2.0 < found["odometry_ate_rmse_m"]
    assert found["path_m"] == pytest.approx(59 * 0.12, abs=0.05)


def test_compare_tells_of_a_reset_too(reset_log, call, in_process):
    done = call("compare", *reset_log, "--mappers", "odometry", "--jobs", "1")
    assert "note: at scan 31 the odometer jumps by " in done.stdout
