"""The injector: passes a robot's readings on, with the faults that strike them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from albot_core.sensing.faults.effect import Effect, Moment, ReadingFault
from albot_core.sensing.faults.fault import Clock, Strikes
from albot_core.sensing.reading import (
    LaserGeometry,
    LaserScan,
    Reading,
    SonarGeometry,
    SonarScan,
)

Arrays = dict[str, np.ndarray]


class FaultInjector:
    """Applies faults to the readings of one robot, in the order of the faults.

    The first reading is never struck: it says where home is. What arrives depends on the readings,
    their clocks and the seed alone.

    Args:
        faults: The faults.
        seed: Selects the random streams of their schedules.
        laser: Geometry of the robot's laser; None without.
        sonar: Geometry of its sonars; None without.
    """

    def __init__(
        self,
        faults: Sequence[ReadingFault],
        seed: tuple[int, ...],
        laser: LaserGeometry | None,
        sonar: SonarGeometry | None,
    ) -> None:
        self._geometries = laser, sonar
        self._strikes = [Strikes(fault, (*seed, k)) for k, fault in enumerate(faults)]
        self._effects: list[Effect | None] = [None] * len(faults)
        self._readings = 0
        self._stamp = 0.0

    @property
    def struck(self) -> int:
        """Number of strikes that have begun."""
        return sum(strikes.count for strikes in self._strikes)

    @property
    def active(self) -> tuple[str, ...]:
        """Names of the faults that struck the latest reading."""
        pairs = zip(self._strikes, self._effects, strict=True)
        return tuple(strikes.fault.name for strikes, effect in pairs if effect is not None)

    def feed(self, reading: Reading, clock: Clock, *, contact: bool = False) -> list[Reading]:
        """Return the readings that arrive when a robot has taken one.

        Args:
            reading: The reading, as it would be without faults.
            clock: When it was taken.
            contact: Whether the robot touched something since the reading before.
        """
        moment = Moment(reading.stamp - self._stamp, contact, self._readings)
        self._stamp, self._readings = reading.stamp, self._readings + 1
        arrived = [reading]
        if moment.number == 0:
            return arrived
        for k, strikes in enumerate(self._strikes):
            arrived = self._strike(k, strikes, arrived, clock, moment)
        return arrived

    def _strike(
        self, k: int, strikes: Strikes, readings: list[Reading], clock: Clock, moment: Moment
    ) -> list[Reading]:
        """Return what one fault lets through of the readings that arrive."""
        effect = self._effects[k]
        if effect is not None and strikes.is_over(clock) and readings:
            self._effects[k] = None
            strikes.end(clock)
            return [*effect.finish(readings[0]), *readings[1:]]
        if effect is None:
            if not readings or not strikes.begin(clock):
                return readings
            fault = strikes.fault
            assert isinstance(fault, ReadingFault)
            effect = self._effects[k] = fault.effect(strikes)
        return [other for each in readings for other in effect.pass_on(each, moment)]

    @property
    def state(self) -> Arrays:
        """All that what arrives next depends on, besides the seed (copies)."""
        arrays = {"fed": np.array((self._readings, self._stamp))}
        for k, (strikes, effect) in enumerate(zip(self._strikes, self._effects, strict=True)):
            arrays[f"{k}.strikes"] = strikes.state
            held = [] if effect is None else effect.held
            arrays |= {f"{k}.{name}": array for name, array in packed(held).items()}
        return arrays

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from a state of the same faults with the same seed."""
        self._readings, self._stamp = int(state["fed"][0]), float(state["fed"][1])
        for k, strikes in enumerate(self._strikes):
            strikes.restore(state[f"{k}.strikes"])
            self._effects[k] = None
            if strikes.is_on:
                fault = strikes.fault
                assert isinstance(fault, ReadingFault)
                effect = self._effects[k] = fault.effect(strikes)
                names = "stamps", "motions", "ranges", "echoes", "scenes"
                held = {name: state[f"{k}.{name}"] for name in names}
                effect.held = unpacked(held, *self._geometries)


def packed(readings: Sequence[Reading]) -> Arrays:
    """Return readings as arrays; `unpacked` is the inverse."""
    lasers = [each.laser.ranges for each in readings if each.laser is not None]
    sonars = [each.sonar.ranges for each in readings if each.sonar is not None]
    return {
        "stamps": np.array([each.stamp for each in readings], np.float64),
        "motions": np.array([each.motion for each in readings], np.float64).reshape(-1, 3),
        "ranges": np.array(lasers, np.float64),
        "echoes": np.array(sonars, np.float64),
        "scenes": np.array(
            [-1 if each.scene is None else each.scene for each in readings], np.int64
        ),
    }


def unpacked(
    arrays: Mapping[str, np.ndarray], laser: LaserGeometry | None, sonar: SonarGeometry | None
) -> list[Reading]:
    """Return the readings that were packed, of a robot with these sensors."""
    ranges, echoes, scenes = arrays["ranges"], arrays["echoes"], arrays["scenes"].tolist()
    return [
        Reading(
            stamp=stamp,
            motion=arrays["motions"][k].copy(),
            laser=None if laser is None else LaserScan(ranges=ranges[k].copy(), geometry=laser),
            sonar=None if sonar is None else SonarScan(ranges=echoes[k].copy(), geometry=sonar),
            scene=None if scenes[k] < 0 else scenes[k],
        )
        for k, stamp in enumerate(arrays["stamps"].tolist())
    ]
