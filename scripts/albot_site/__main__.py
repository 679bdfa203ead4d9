"""`python -m albot_site`: draws the pictures of the documentation."""

from __future__ import annotations

from pathlib import Path

import click

from albot_cli.main import exit_status
from albot_site.sources import ROOT


@click.group()
def site() -> None:
    """Draw the pictures of the documentation. `mkdocs build --strict` builds the site itself."""


@site.command()
@click.option("--again", is_flag=True, help="Draw also those that there are.")
@click.option("--only", default="", help="Draw those with this in the names of their files.")
def gallery(again: bool, only: str) -> None:
    """Draw the pictures of the gallery to docs/gallery."""
    from albot_site.gallery import draw_all

    for line in draw_all(again, only):
        click.echo(f"not drawn: {line}", err=True)


@site.command()
@click.option("--out", type=click.Path(path_type=Path), default=ROOT / "docs/images/play.gif")
@click.option("--world", default="office-ring", help="Spec of the world.")
@click.option("--seed", default=1)
@click.option("--steps", default=2400, help="Steps of the episode.")
@click.option("--every", default=30, help="Steps from picture to picture.")
def film(out: Path, world: str, seed: int, steps: int, every: int) -> None:
    """Film an exploration as a GIF, that of the README by default."""
    from albot_site.film import film as film_episode

    pictures = film_episode(out, world=world, seed=seed, steps=steps, every=every)
    click.echo(f"{out}: {pictures} pictures, {out.stat().st_size / 1e6:.2f} MB")


@site.command()
@click.argument("notebook", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--out", type=click.Path(file_okay=False, path_type=Path))
def tutorial(notebook: Path, out: Path | None) -> None:
    """Run the cells of a NOTEBOOK, and keep what they print and draw for its page."""
    from albot_site.tutorials import OUTPUTS, run_cells

    folder = out or OUTPUTS
    folder.mkdir(parents=True, exist_ok=True)
    run_cells(notebook, folder)


if __name__ == "__main__":
    exit_status(site)
