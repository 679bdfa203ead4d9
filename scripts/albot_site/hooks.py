"""Hooks of mkdocs: they add the generated pages, and lead links to files outside docs/ to pages."""

from __future__ import annotations

import logging
import re
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from albot_site.pages import generated_pages, generated_sections
from albot_site.sources import ROOT, addresses, imported_files, imported_pages, relink

_LOG = logging.getLogger("mkdocs.albot_site")
_LOADED = re.compile(r'<(?:script|link|img|iframe)\b[^>]*?(?:src|href)="(https?://[^"]*)"')


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put generated sections into the navigation, where it names their folder."""
    config.nav = _with_sections(config.nav, generated_sections())
    return config


def _with_sections(entries: Any, sections: dict[str, Any]) -> Any:
    if isinstance(entries, list):
        return [_with_sections(entry, sections) for entry in entries]
    if isinstance(entries, dict):
        return {title: _with_sections(content, sections) for title, content in entries.items()}
    return sections.get(entries, entries)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and pictures that are no files of docs/."""
    for address, text in generated_pages().items():
        files.append(File.generated(config, address, content=text))
    for path, address in {**imported_pages(), **imported_files()}.items():
        files.append(File.generated(config, address, abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Lead the page's links to files outside docs/ into the site."""
    address = page.file.src_uri
    sources = {there: path for path, there in imported_pages().items()}
    return relink(markdown, sources.get(address, f"docs/{address}"), address, addresses())


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Warn, and so fail a strict build, if a page loads anything over a network."""
    for address in _LOADED.findall(output):
        _LOG.warning("%s loads %s, which a folder does not hold", page.file.src_uri, address)
    return output
