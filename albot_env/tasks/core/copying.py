"""Copies of environments: made from their settings, and put into their state."""

from __future__ import annotations

import copy
from abc import abstractmethod
from typing import Any

_NOT_COPIED = frozenset({"_np_random", "_np_random_seed", "closed"})
"""Attributes that gymnasium adds after the construction, and that the state holds or that a copy
does without."""


class CopiedByState:
    """What makes an environment copyable and picklable, although its physics is C code.

    A copy has the same settings, is in the same state and goes on alike. It records nothing, has no
    agent's name, and a copy of one with a window has none. Attributes that others have added are
    copied with it.
    """

    _given: dict[str, Any]
    """The arguments of the constructor, by name."""
    _own: frozenset[str]
    """Names of the attributes that the constructor sets."""

    @abstractmethod
    def _whole_state(self) -> Any:
        """Return the state of all episodes and generators; checks that it is open."""

    @abstractmethod
    def _set_whole_state(self, state: Any) -> None:
        """Restore what `_whole_state` returned."""

    @abstractmethod
    def _shared(self) -> dict[str, Any]:
        """Return those arguments of the constructor that copies in this process share."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what pickling needs.

        Raises:
            ClosedEnvironmentError: The environment has been closed.
        """
        return self._parts({})

    def __setstate__(self, parts: dict[str, Any]) -> None:
        given = dict(parts["given"])
        if given.get("render_mode") == "human":
            given["render_mode"] = None
        base = next(kind for kind in type(self).__mro__ if CopiedByState in kind.__bases__)
        base.__init__(self, **given)  # type: ignore[misc]
        vars(self).update(parts["added"])
        self._set_whole_state(parts["state"])

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        """Return an independent copy that goes on as this one, to the bit.

        Raises:
            ClosedEnvironmentError: The environment has been closed.
        """
        twin = type(self).__new__(type(self))
        memo[id(self)] = twin
        parts = self._parts(self._shared())
        twin.__setstate__(parts | {"added": copy.deepcopy(parts["added"], memo)})
        return twin

    def __copy__(self) -> Any:
        """Return the same as `copy.deepcopy`: two environments cannot share one robot."""
        return copy.deepcopy(self)

    def _parts(self, shared: dict[str, Any]) -> dict[str, Any]:
        state = self._whole_state()
        names = vars(self).keys() - self._own - _NOT_COPIED - {"_own", "_given"}
        added = {name: vars(self)[name] for name in names}
        return {"given": self._given | shared, "state": state, "added": added}
