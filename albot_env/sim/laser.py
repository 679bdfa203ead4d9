"""The laser: a SICK LMS-200-like scanner whose ranges are noisy and sometimes missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from jaxtyping import Float64
from scipy.special import ndtri

from albot_core.ranges import NOT_NEGATIVE, SHARE, check_fields
from albot_core.sensing.reading import LaserGeometry
from albot_env.sim.sensing_kernels import NORMALS


@dataclass(frozen=True, kw_only=True)
class LaserConfig:
    """The laser's beams and errors.

    One centimetre of noise stands for all errors of a LMS-200's ranges; the rate of
    drop-outs is ours.
    """

    geometry: LaserGeometry = field(default_factory=LaserGeometry)
    """Where the beams point, how far they reach, and where the laser sits."""
    range_noise: float = 0.01
    """Standard deviation of a range (m)."""
    dropout: float = 0.001
    """Probability that a beam which meets a wall brings nothing back."""

    def __post_init__(self) -> None:
        check_fields(self, NOT_NEGATIVE, "range_noise")
        check_fields(self, SHARE, "dropout")

    @property
    def dropout_threshold(self) -> int:
        """The drop-out's probability as a share of 2^32, as the compiled laser takes it."""
        return round(self.dropout * 2**32)


LMS_200 = LaserConfig()
"""The papers' laser."""

_FINE = LaserGeometry(beams=361, spacing=np.pi / 360)

LASERS: Mapping[str, LaserConfig] = MappingProxyType(
    {
        "ideal": LaserConfig(range_noise=0.0, dropout=0.0),
        "lms-200": LMS_200,
        "lms-200-fine": LaserConfig(geometry=_FINE),
        "long": LaserConfig(geometry=LaserGeometry(max_range=80.0)),
        "short": LaserConfig(geometry=LaserGeometry(max_range=8.0), range_noise=0.005),
    }
)
"""The lasers by name. All see a half turn ahead.

`ideal`: 181 beams, 30 m, no error.

`lms-200`: 181 beams at 1°, 30 m; `lms-200-fine`: 361 at 0.5°.

`long`: 80 m, as far as a SICK LMS-200 measures at all (Hossain's thesis, section 3.2); with
30 m, the others stop where dark walls stop it.

`short`: 8 m and half the noise, as it is when set to measure in millimetres.
"""


def normal_table(deviation: float) -> Float64[np.ndarray, "numbers"]:
    """Numbers that, each as likely as the others, are normal with this standard deviation.

    The middles of as many parts of the normal distribution, all equally likely; scaled, for
    the middles of the outermost leave a little of the variance out.
    """
    quantiles = ndtri((np.arange(NORMALS) + 0.5) / NORMALS)
    return np.asarray(deviation * quantiles / quantiles.std())
