"""The sources of all compiled functions: whether code that was compiled before is still theirs.

numba keeps compiled code beside the source and looks only at the file that a function stands in.
One that it calls may have changed in another file, or be gone, after an update in place.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("albot_core", "albot_maps", "albot_env", "albot_agents")
"""Where compiled functions may stand."""
_MARKS = (b"numba", b"albot_core.compiled")


@cache
def kernel_stamp() -> str:
    """A digest of all files of ours that compiled functions are made of."""
    folders = []
    for package in PACKAGES:
        spec = find_spec(package)
        folders += (spec.submodule_search_locations or []) if spec is not None else []
    return digest(map(Path, folders))


def digest(folders: Iterable[Path]) -> str:
    """A digest of the Python files below these folders that have to do with compiled functions."""
    summed = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            source = path.read_bytes()
            if any(mark in source for mark in _MARKS):
                summed.update(hashlib.sha256(source).digest())
    return summed.hexdigest()
