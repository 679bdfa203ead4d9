"""The documentation as a site: its generated pages, and the pictures in it.

`mkdocs build --strict` builds the site with the hooks in `hooks.py`; `python -m albot_site` draws
the pictures.
"""
