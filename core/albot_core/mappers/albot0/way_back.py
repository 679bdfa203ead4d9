"""How the robot finds its way back along the way out.

The paper does not tell how its robot chooses where to go on its way home: this is ours. The last
metres of the way home are compared with the way out by their shape alone, about where the robot
should be on it by now. Where they fit best, the way out lies beside the way home, and shows where
to go. So what the odometer errs in the long run is of no weight.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from albot_core.errors import InputError
from albot_core.geometry.poses import inverse, transform_points
from albot_core.geometry.types import Points, Pose, Segments
from albot_core.mappers.stored_arrays import check_finite, check_shapes

_GAP = 0.5
"""Ways are compared by points so far apart (m)."""
_LONGEST, _LEAST = 10.0, 4.0
"""How much of the way home is compared, and how much there must be (m)."""
_SHAPE, _ALONG = 0.4, 1.0
"""Standard deviations (m) of the way home's points from those of the way out, and of how far along
the robot is from how far it should be."""
_TURNED = 0.25
"""Standard deviation of how far the way home has turned since it was last laid (rad)."""
_MOVED = 0.5
"""…and has moved since (m)."""
_ABOUT = 2.0
"""No farther away from where it should be is it looked for (m)."""
_AHEAD = 1.5
"""The robot is shown a point so far ahead (m)."""
_BEHIND, _BEYOND = 1.0, 2.0
"""Where it is on the way out is looked for from so far behind to so far beyond what it has come
since its last stop (m)."""
_SAME = 0.6
"""Where the way out comes by again no farther away (m), what lies between is left out."""


class WayBack:
    """The way out, from where the robot turned round to its home.

    Attributes:
        frame: The frame of the way out, as it lies beside the way home.

    Args:
        out: The steps of the way out (m).
    """

    def __init__(self, out: Segments) -> None:
        self._points = _points_along(out[::-1, (2, 3, 0, 1)])
        self.frame = np.zeros(3)
        self._place = 0
        self._followed = 0.0

    @property
    def along(self) -> float:
        """How far the robot was along the way, from where it turned round, at its last stop (m)."""
        return _GAP * self._place

    def locate(self, home: Segments, travelled: float) -> None:
        """Lay the way out beside the way home.

        Args:
            home: The steps of the way home (m).
            travelled: How far the robot has come since it was last located (m).
        """
        place, skips = self._find(home[-1, 2:], travelled)
        self._place = place
        self._followed = 0.0 if skips else self._followed + travelled
        back = _points_along(home[::-1, (2, 3, 0, 1)])
        count = int(min(self._followed, _LONGEST) / _GAP) + 1
        first = max(place - int(_ABOUT / _GAP), count - 1)
        last = min(place + int(_ABOUT / _GAP), len(self._points) - 1)
        if self._followed < _LEAST or first > last or count > len(back):
            return
        # As complex numbers: turning is multiplying.
        here = back[:count] @ (1, 1j)
        stretches = np.lib.stride_tricks.sliding_window_view(self._points @ (1, 1j), count)
        there = stretches[first - count + 1 : last - count + 2, ::-1]
        middle, middles = here.mean(), there.mean(axis=1)
        here, there = here - middle, there - middles[:, None]
        common = (there.conj() * here).sum(axis=1)
        squares = (np.abs(there) ** 2).sum(axis=1) + (np.abs(here) ** 2).sum() - 2 * np.abs(common)
        off = _GAP * (np.arange(first, last + 1) - place)
        turns = np.angle(common)
        turned = np.angle(np.exp(1j * (turns - self.frame[2])))
        apart = np.sqrt(np.maximum(squares, 0.0) / count)
        # Where on the way out the robot would be, and where it is by what was found before.
        would_be = middles + here[0] * np.exp(-1j * turns)
        is_at = transform_points(inverse(self.frame), home[-1, 2:]) @ (1, 1j)
        moved = np.abs(would_be - is_at)
        misfit = (apart / _SHAPE) ** 2 + (off / _ALONG) ** 2
        misfit += (turned / _TURNED) ** 2 + (moved / _MOVED) ** 2
        best = int(misfit.argmin())
        if apart[best] > _SHAPE * 1.5:
            return
        turn = turns[best]
        shift = middle - middles[best] * np.exp(1j * turn)
        self.frame = np.array((shift.real, shift.imag, turn))
        self._place = first + best

    def ahead(self, pose: Pose, travelled: float) -> tuple[Points, float]:
        """A point a little ahead on the way home, and how far it is home along the way (m).

        The point is NaN where home is nearer.

        Args:
            pose: Where the robot is.
            travelled: How far it has come since it was last located (m).
        """
        place, _ = self._find(pose[:2], travelled)
        ahead = place + int(_AHEAD / _GAP)
        goal = self._points[ahead] if ahead < len(self._points) else np.full(2, np.nan)
        return transform_points(self.frame, goal), _GAP * (len(self._points) - 1 - place)

    def _find(self, position: Points, travelled: float) -> tuple[int, bool]:
        """Where on the way a position of the map is; and whether something is left out by it."""
        away = np.hypot(*(transform_points(inverse(self.frame), position) - self._points).T)
        first = max(self._place - int(_BEHIND / _GAP), 0)
        last = self._place + int((travelled + _BEYOND) / _GAP) + 1
        place = first + int(away[first:last].argmin())
        again = np.flatnonzero(away[last:] < _SAME)
        return (last + int(again[-1]), True) if len(again) else (place, False)

    def state(self) -> np.ndarray:
        """All that changes, as one array."""
        return np.array((*self.frame, self._place, self._followed))

    def restore(self, name: str, state: np.ndarray) -> None:
        """Become what gave `state`.

        Raises:
            InputError: The array of this name is none that a state holds.
        """
        check_shapes({name: state}, {name: (5,)})
        check_finite({name: state}, name)
        *frame, place, followed = state.tolist()
        if not (0 <= place < len(self._points) and place == int(place) and followed >= 0):
            raise InputError(name, f"a place of {len(self._points)} and a length", str(state))
        self.frame, self._place, self._followed = np.array(frame), int(place), followed


def _points_along(way: Segments) -> Float64[np.ndarray, "points 2"]:
    """Points of a way, evenly spaced, from its beginning on."""
    corners = np.concatenate((way[:1, :2], way[:, 2:]))
    at = np.concatenate((np.zeros(1), np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
    places = np.arange(0.0, at[-1] + _GAP, _GAP)
    return np.stack([np.interp(places, at, corners[:, axis]) for axis in (0, 1)], axis=-1)
