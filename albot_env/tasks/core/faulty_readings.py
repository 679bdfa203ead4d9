"""What arrives of the robots' readings where faults strike."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float64, Int64

from albot_core.mappers.mapper import MapperBatch
from albot_core.robot import CONTROL_STEP
from albot_core.sensing.faults.effect import ReadingFault
from albot_core.sensing.faults.fault import Clock, Fault
from albot_core.sensing.faults.injector import FaultInjector, packed, unpacked
from albot_core.sensing.reading import LaserGeometry, Reading, Readings, SonarGeometry
from albot_env.tasks.core.row_arrays import Arrays

FAULT_STREAM = 2
"""Number of the random stream of a robot's faults; 1 is its mapper's."""


class FaultyReadings:
    """Passes the readings of a batch of robots on, with the faults that strike them.

    A step may bring a robot no reading, or several. Its arrays then hold the last one that arrived;
    where none did, the one before, without motion.

    Args:
        robots: Number of robots.
        faults: The faults of readings; each robot has its own schedule.
        laser: Geometry of the lasers; None without.
        sonar: Geometry of the sonars; None without.
    """

    def __init__(
        self,
        robots: int,
        faults: Sequence[ReadingFault],
        laser: LaserGeometry | None,
        sonar: SonarGeometry | None,
    ) -> None:
        self._faults = faults
        self._geometries = laser, sonar
        self._injectors: list[FaultInjector | None] = [None] * robots
        self._latest: list[Reading | None] = [None] * robots
        self._taken: list[list[int]] = [[] for _ in range(robots)]
        self._before = np.zeros(robots, np.int64)
        self._travelled = np.zeros(robots)
        self.stamps: Float64[np.ndarray, "robots"] = np.zeros(robots)
        """Stamps of the readings that arrived last (s)."""
        self.arrived: Int64[np.ndarray, "robots"] = np.ones(robots, np.int64)
        """Number of readings that arrived in the last step."""

    def begin(self, row: int, key: int) -> None:
        """Begin the episode of a robot; its key selects the random streams."""
        seed = key, FAULT_STREAM
        self._injectors[row] = FaultInjector(self._faults, seed, *self._geometries)
        self._latest[row], self._taken[row] = None, []
        self.stamps[row], self.arrived[row] = 0.0, 1

    def active(self, row: int) -> tuple[str, ...]:
        """Return the names of the faults that struck a robot's latest reading."""
        return self._of(row).active

    def struck(self, row: int) -> int:
        """Return the number of strikes on a robot that have begun."""
        return self._of(row).struck

    def _of(self, row: int) -> FaultInjector:
        injector = self._injectors[row]
        assert injector is not None, "a robot has no readings before it begins"
        return injector

    def arrivals(
        self,
        rows: Int64[np.ndarray, "some"],
        readings: Readings,
        taken: Int64[np.ndarray, "robots"],
        travelled: Float64[np.ndarray, "robots"],
        contacts: Bool[np.ndarray, "robots"],
    ) -> Iterator[tuple[Int64[np.ndarray, "some"], Readings]]:
        """Yield the robots to which a reading arrives, with the readings; again for second ones.

        Args:
            rows: The robots that have taken a reading.
            readings: The readings of all robots; their arrays are overwritten with what arrives.
            taken: Number of readings that each has taken since it was placed.
            travelled: Distance that each has driven (m).
            contacts: Which of them have touched something since the reading before.
        """
        arrived: dict[int, list[Reading]] = {}
        for row in rows.tolist():
            reading = readings[row]
            if reading.stamp == 0.0:
                self._before[row], self._travelled[row] = taken[row] - 1, travelled[row]
            clock = Clock(reading.stamp, float(travelled[row] - self._travelled[row]))
            found = self._of(row).feed(reading, clock, contact=bool(contacts[row]))
            arrived[row], self.arrived[row] = found, len(found)
            self._taken[row] += [round(each.stamp / CONTROL_STEP) for each in found]
            if not found:
                latest = self._latest[row]
                assert latest is not None, "the first reading always arrives"
                self._show(row, replace(latest, motion=np.zeros(3)), readings)
        shown = replace(readings, stamps=self.stamps)
        for k in range(max(map(len, arrived.values()), default=0)):
            having = [row for row, found in arrived.items() if k < len(found)]
            for row in having:
                self._show(row, arrived[row][k], readings)
                self._latest[row] = arrived[row][k]
            yield np.array(having), shown

    def _show(self, row: int, reading: Reading, readings: Readings) -> None:
        """Write a robot's reading into the arrays of all."""
        self.stamps[row] = reading.stamp
        readings.motions[row] = reading.motion
        if readings.ranges is not None and reading.laser is not None:
            readings.ranges[row] = reading.laser.ranges
        if readings.echoes is not None and reading.sonar is not None:
            readings.echoes[row] = reading.sonar.ranges
        if readings.scenes is not None:
            readings.scenes[row] = -1 if reading.scene is None else reading.scene

    def taken(self, row: int, arrival: int) -> int:
        """Return the number of the reading that a robot's mapper was given as its `arrival`-th.

        Both are counted from 0 since the robot set out; -1 stays.
        """
        before = int(self._before[row])
        return arrival if arrival < before else before + self._taken[row][arrival - before]

    def state(self, row: int) -> Arrays:
        """Return all that what arrives at a robot depends on (copies)."""
        latest = self._latest[row]
        return {
            **{f"faults.{name}": array for name, array in self._of(row).state.items()},
            **{
                f"latest.{name}": array
                for name, array in packed([] if latest is None else [latest]).items()
            },
            "faults.taken": np.array(self._taken[row], np.int64),
            "faults.before": np.array((self._before[row], self.arrived[row])),
            "faults.travelled": np.array((self._travelled[row], self.stamps[row])),
        }

    def set_state(self, row: int, key: int, arrays: Arrays) -> None:
        """Give a robot with a key what `state` returned."""
        self.begin(row, key)
        own = {name[7:]: array for name, array in arrays.items() if name[:7] == "faults."}
        self._of(row).restore(own)
        latest = {name[7:]: array for name, array in arrays.items() if name[:7] == "latest."}
        held = unpacked(latest, *self._geometries)
        self._latest[row] = held[0] if held else None
        self._taken[row] = own["taken"].tolist()
        self._before[row], self.arrived[row] = own["before"].tolist()
        self._travelled[row], self.stamps[row] = own["travelled"].tolist()


class TakenReadings:
    """The readings that mappers match, by the numbers at which they were taken.

    A mapper counts the readings that arrive. Where some were lost or doubled, these are others than
    those that were taken. It stands for the mappers where their matches are judged.

    Args:
        robots: Number of robots.
        mappers: The mappers.
        readings: What has arrived.
    """

    def __init__(self, robots: int, mappers: MapperBatch, readings: FaultyReadings) -> None:
        self._mappers, self._readings = mappers, readings
        self.matched_readings: Int64[np.ndarray, "robots"] = np.full(robots, -1)
        """Number of the matched reading of each robot, -1 for none; always the same array."""

    @property
    def recognises_places(self) -> bool:
        """Whether the mappers remember places."""
        return self._mappers.recognises_places

    def match_readings(self, rows: Int64[np.ndarray, "some"]) -> None:
        """Bring `matched_readings` of some rows up to date."""
        self._mappers.match_readings(rows)
        for row in rows.tolist():
            matched = int(self._mappers.matched_readings[row])
            self.matched_readings[row] = self._readings.taken(row, matched)


def faults_of_readings(faults: Sequence[Fault]) -> list[ReadingFault]:
    """Return those faults that are faults of readings."""
    return [fault for fault in faults if isinstance(fault, ReadingFault)]
