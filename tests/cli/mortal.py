"""A mapper whose process is killed at its twentieth reading; importing this registers it."""

from __future__ import annotations

import os
import signal

from albot_core.mappers.mapper import MapperSpec
from albot_core.mappers.odometry.mapper import OdometryMapper
from albot_core.mappers.registry import register_mapper
from albot_core.sensing.reading import Reading


class Mortal(OdometryMapper):
    """It dies where the log's clock says 19.5 s."""

    def update(self, reading: Reading) -> bool:
        if reading.stamp > 19:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().update(reading)


register_mapper(
    MapperSpec(
        name="mortal",
        summary="Dies.",
        paper="none",
        sensors=frozenset({"laser"}),
        layers=("segments",),
        factory="tests.cli.mortal:Mortal",
        config="albot_core.mappers.odometry.batch:OdometryConfig",
    )
)
