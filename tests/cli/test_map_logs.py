"""`albot map` on real logs."""

from __future__ import annotations

import lzma

import pytest

from tests.cli.conftest import FILES, PLACES, figures


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
    told = figures(call("map", logs / name, *(intel if "intel" in name else []), "--json"))
    assert told["odometry_ate_rmse_m"] == pytest.approx(odometry, abs=0.1)
    assert told["ate_rmse_m"] < limit
    if "intel" in name:
        assert told["relations"]["count"] == 90
        assert told["relations"]["translation_mean_m"] < 1.0


@pytest.mark.parametrize(
    ("name", "scans"),
    [("wean_robotdata1.log.xz", 713), ("wean_robotdata2.log.xz", 2251), ("duke_loop5.log.xz", 551)],
)
def test_raw_logs_without_a_reference(name, scans, call, data, tmp_path):
    told = figures(call("map", data / "logs" / name, "--out", tmp_path / "out", "--json"))
    assert told["scans"] == scans
    assert told["ate_rmse_m"] is None
    assert told["map_entropy"] < told["odometry_map_entropy"] - 0.1
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
    assert figures(done)["note"].startswith("the log's odometry is constant")
    assert "the log's odometry is constant" in done.stderr
