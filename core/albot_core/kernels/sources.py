"""The sources of all compiled functions: whether code that was compiled before is still theirs.

numba keeps compiled code beside the source and looks only at the file that a function stands in.
One that it calls, or a constant that it takes, may have changed in another file, or be gone, after
an update in place.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable
from functools import cache
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("albot_core", "albot_maps", "albot_env")
"""Where compiled functions stand."""
_MARKS = (b"numba", b"albot_core.kernels.compiled")
_IMPORTED = re.compile(rb"^\s*(?:from|import) ([\w.]+)", re.MULTILINE)


@cache
def kernel_stamp() -> str:
    """A digest of all files of ours that compiled functions are made of."""
    folders = []
    for package in PACKAGES:
        spec = find_spec(package)
        folders += (spec.submodule_search_locations or []) if spec is not None else []
    return digest(map(Path, folders))


def digest(packages: Iterable[Path]) -> str:
    """A digest of the files that have to do with compiled functions, and of what these import.

    Args:
        packages: The folders of the packages, named as these are; others are not looked into.
    """
    sources = {}
    for package in packages:
        for path in package.rglob("*.py"):
            parts = package.name, *path.relative_to(package).with_suffix("").parts
            sources[".".join(parts).removesuffix(".__init__").encode()] = path.read_bytes()
    waiting = [name for name, text in sources.items() if any(mark in text for mark in _MARKS)]
    reached = set(waiting)
    while waiting:
        found = {name for name in _IMPORTED.findall(sources[waiting.pop()]) if name in sources}
        waiting += found - reached
        reached |= found
    summed = hashlib.sha256()
    for name in sorted(reached):
        summed.update(name + b"\0" + hashlib.sha256(sources[name]).digest())
    return summed.hexdigest()
