"""Where a file of the repository is in the site, and links that lead there.

Pages link to files as a code host shows them: relative to their own place in the repository. A
Python module is in the site as its page of the API, a model card or a document outside docs/ as a
page of its own.
"""

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterator, Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = {
    "albot_core": ROOT / "core/albot_core",
    "albot_maps": ROOT / "maps/albot_maps",
    "albot_env": ROOT / "albot_env",
    "albot_agents": ROOT / "agents/albot_agents",
}
"""The public packages and their folders."""
API = "reference/api"
"""Folder of the pages of the API."""
_CARDS = "agents/albot_agents/trained"
_LINK = re.compile(r"(!?\[[^\]]*\]\()([^)\s#]+)(#[^)\s]*)?\)")
_CODE = re.compile(r"(^ *```.*?^ *```$)", re.DOTALL | re.MULTILINE)


def modules() -> Iterator[tuple[str, Path]]:
    """Yield the name and file of each public module, a package before what is in it."""
    for package, folder in PACKAGES.items():
        for path in sorted(folder.rglob("*.py"), key=_package_first):
            parts = (package, *path.relative_to(folder).with_suffix("").parts)
            yield ".".join(part for part in parts if part != "__init__"), path


def _package_first(path: Path) -> tuple[str, ...]:
    return path.parts[:-1] if path.name == "__init__.py" else path.parts


def module_page(module: str) -> str:
    """Return the address of a module's page in the site."""
    return f"{API}/{module}.md"


def imported_pages() -> dict[str, str]:
    """Return the documents outside docs/ that are pages: their paths, and their addresses."""
    cards = sorted((ROOT / _CARDS).glob("*.md"))
    return {
        "CONTRIBUTING.md": "develop/contributing.md",
        "CHANGELOG.md": "develop/changelog.md",
        "README.md": "index.md",
    } | {f"{_CARDS}/{card.name}": f"cards/{card.name}" for card in cards}


def imported_files() -> dict[str, str]:
    """Return the files outside docs/ to which imported pages lead: paths and addresses."""
    pictures = sorted((ROOT / _CARDS).glob("*.png"))
    cards = {f"{_CARDS}/{picture.name}": f"cards/{picture.name}" for picture in pictures}
    return cards | {"CITATION.cff": "CITATION.cff"}


def addresses() -> dict[str, str]:
    """Return the address of each file that is in the site as another one, by its path."""
    sources = {path.relative_to(ROOT).as_posix(): module_page(module) for module, path in modules()}
    notebooks = sorted((ROOT / "docs/tutorials").glob("*.ipynb"))
    others = {f"docs/tutorials/{book.name}": f"tutorials/{book.stem}.md" for book in notebooks}
    others["docs/plans"] = "reference/plans.md"
    return sources | imported_pages() | imported_files() | others


def relink(text: str, source: str, address: str, known: Mapping[str, str]) -> str:
    """Return a page with the links to files outside docs/ leading into the site.

    Args:
        text: The page.
        source: Its path in the repository.
        address: Its address in the site.
        known: The addresses of files outside docs/, by path (`addresses`).

    Links to files that are not in the site stay as they are; a strict build reports them.
    """

    def replaced(link: re.Match[str]) -> str:
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), link[2]))
        there = known.get(target)
        if there is None and target.startswith("docs/") and source != f"docs/{address}":
            there = target.removeprefix("docs/")
        if "://" in link[2] or there is None:
            return link[0]
        relative = posixpath.relpath(there, posixpath.dirname(address) or ".")
        return f"{link[1]}{relative}{link[3] or ''})"

    parts = _CODE.split(text)
    parts[::2] = [_LINK.sub(replaced, part) for part in parts[::2]]
    return "".join(parts)
