"""The stamp of compiled code: a digest of all files that may be part of it.

numba keeps compiled code beside the source, and checks only the file that defines the function. But
a function that it calls, or a constant that it uses, may have changed in another file. All of these
are imported. So the stamp of a module is a digest of its own file and of all files that it imports,
directly or indirectly.
"""

from __future__ import annotations

import hashlib
import re
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

PACKAGES = ("albot_core", "albot_maps", "albot_env")
"""Our packages that have compiled functions."""
_IMPORTS = re.compile(
    rb"^[ \t]*(?:from[ \t]+([.\w]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)|import[ \t]+([^\n]*))",
    re.MULTILINE,
)
_NAME = re.compile(rb"[\w.]+")
_INSTALLED = frozenset(("site-packages", "dist-packages"))


class SourceFile(NamedTuple):
    """A module's file."""

    name: str
    """The module's full name."""
    path: Path
    """The file."""


@cache
def stamp_of(module: str, path: Path) -> str:
    """Return the digest of a module's file and of all files that it imports, directly or not.

    Files of our packages and of the module's own package are followed; for a module that is not
    installed, also the files beside it. A file that cannot be read counts as empty.

    Args:
        module: The module's full name.
        path: Its file.
    """
    # A program's own file has a name that is no module's.
    first = SourceFile(path.stem if module == "__main__" else module, path)
    reached, waiting = {first}, [first]
    while waiting:
        found = _imported(waiting.pop()) - reached
        reached |= found
        waiting += found
    summed = hashlib.sha256()
    for file in sorted(reached):
        summed.update(f"{file.name}\0{_digest(file.path)}\0".encode())
    return summed.hexdigest()


@cache
def _imported(file: SourceFile) -> frozenset[SourceFile]:
    """Return the files that a file imports, as far as they are followed."""
    parts = file.name.split(".")
    is_package = file.path.stem == "__init__"
    folder = file.path.parents[len(parts) - (0 if is_package else 1)]
    package = parts if is_package else parts[:-1]
    names = set()
    for origin, listed, plain in _IMPORTS.findall(_text(file.path)):
        if plain:
            names |= {name.decode() for name in _NAME.findall(plain)}
            continue
        from_ = origin.decode()
        level = len(from_) - len(from_.lstrip("."))
        above = package[: len(package) - level + 1] if level else []
        base = ".".join((*above, *filter(None, from_[level:].split("."))))
        names |= {base, *(f"{base}.{name.decode()}" for name in _NAME.findall(listed))}
    found = (_file_of(name, folder, parts[0]) for name in names)
    return frozenset(one for one in found if one is not None)


@cache
def _file_of(name: str, folder: Path, package: str) -> SourceFile | None:
    """Return the file of a module, or None if the module is not followed.

    Args:
        name: The module's full name.
        folder: The folder that contains the package of the importing module.
        package: That package's name.
    """
    first, *others = name.split(".")
    if first in PACKAGES:
        found = _folder_of(first)
        if found is None:
            return None
        folder = found
    elif (
        first != package and any(part in _INSTALLED for part in folder.parts)
    ) or first in sys.stdlib_module_names:
        return None
    for path in (folder.joinpath(first, *others, "__init__.py"), folder.joinpath(first, *others)):
        path = path if path.name == "__init__.py" else path.with_suffix(".py")
        if path.is_file():
            return SourceFile(name, path)
    return None


@cache
def _folder_of(package: str) -> Path | None:
    """Return the folder that contains one of our packages."""
    spec = find_spec(package)
    places = (spec.submodule_search_locations or []) if spec is not None else []
    return next((Path(place).parent for place in places), None)


@cache
def _text(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError:
        return b""


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(_text(path)).hexdigest()
