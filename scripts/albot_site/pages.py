"""All generated pages, and the sections of the navigation that hold many of them."""

from __future__ import annotations

from typing import Any

from albot_site.command_line import command_line_page
from albot_site.configurations import configuration_pages
from albot_site.formats import format_pages
from albot_site.gallery import gallery_page
from albot_site.reference import api_nav, api_pages
from albot_site.sources import API, ROOT, imported_pages
from albot_site.tutorials import tutorial_pages


def generated_pages() -> dict[str, str]:
    """Return the text of each generated page by its address."""
    return {
        **api_pages(),
        **configuration_pages(),
        **format_pages(),
        **tutorial_pages(),
        "reference/command_line.md": command_line_page(),
        "gallery.md": gallery_page(),
    }


def generated_sections() -> dict[str, list[Any]]:
    """Return the sections of the navigation, by the folder that stands for each in mkdocs.yml."""
    docs = ROOT / "docs"
    reports = sorted((docs / "experiments").glob("*/report.md"))
    cards = sorted(page for page in imported_pages().values() if page.startswith("cards/"))
    return {
        API: api_nav(),
        "cards": cards,
        "experiments": [{path.parent.name: path.relative_to(docs).as_posix()} for path in reports],
    }
