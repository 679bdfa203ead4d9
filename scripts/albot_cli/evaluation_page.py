"""The page of an evaluation's recorded episodes: one file, without scripts."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from albot_agents.evaluation.paired import FIGURES, episode_figures
from albot_agents.evaluation.recordings import Recording
from albot_agents.evaluation.trial import Outcome
from albot_core.counts import many
from albot_env.rendering.frame import clock_time

INDEX = "index.html"
"""Name of the page."""
_OUTCOMES = {True: "success", False: "failure", None: "over"}
"""How an episode ended, by the success that its info tells."""
_STYLE = """
:root { color-scheme: light dark; --ground: #fff; --card: #f5f6f8; --text: #22262b;
  --faint: #59626d; --rule: #d9dde2; --success: #0b7a50; --failure: #a1286a; --link: #224c98; }
@media (prefers-color-scheme: dark) { :root { --ground: #16181d; --card: #1e2128; --text: #dee2e9;
  --faint: #99a2b0; --rule: #343944; --success: #57b57c; --failure: #e87db0; --link: #9aa9ff; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 1360px; padding: 1.5rem; background: var(--ground);
  color: var(--text); font: 15px/1.45 system-ui, sans-serif; }
h1 { font-size: 1.4rem; margin: 0; overflow-wrap: anywhere; }
h2 { font-size: 1rem; margin: 0; overflow-wrap: anywhere; }
p { margin: .3rem 0; color: var(--faint); }
main { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(400px, 100%), 1fr));
  gap: 1rem; margin-top: 1.2rem; }
article { background: var(--card); border: 1px solid var(--rule); border-radius: 8px;
  padding: .8rem; min-width: 0; }
article.success { border-left: 4px solid var(--success); }
article.failure { border-left: 4px solid var(--failure); }
header { display: flex; gap: .8rem; justify-content: space-between; align-items: baseline; }
.success b { color: var(--success); } .failure b { color: var(--failure); }
img { display: block; width: 100%; height: auto; border-radius: 6px; margin: .6rem 0; }
dl { display: grid; grid-template-columns: auto 1fr; gap: .1rem .8rem; margin: .6rem 0; }
dt { color: var(--faint); } dd { margin: 0; text-align: right;
  font-variant-numeric: tabular-nums; }
a { color: var(--link); } nav { display: flex; flex-wrap: wrap; gap: .2rem 1rem; }
summary { cursor: pointer; color: var(--faint); margin-top: .4rem; }
pre { margin: .4rem 0 0; padding: .5rem; border: 1px solid var(--rule); border-radius: 6px;
  white-space: pre-wrap; overflow-wrap: anywhere; font-size: 13px; }
"""


def index_page(title: str, notes: Sequence[str], outcomes: Sequence[Outcome]) -> str:
    """Return the page that lists the episodes that were kept, failures first.

    Args:
        title: Its heading.
        notes: Lines below the heading.
        outcomes: All episodes, in the order in which they are listed otherwise.
    """
    kept = [(each, each.recording) for each in outcomes if each.recording is not None]
    kept.sort(key=lambda pair: pair[0].info.get("is_success") in (None, True))
    several = len({outcome.agent for outcome in outcomes}) > 1
    cards = "\n".join(_card(outcome, its, several) for outcome, its in kept)
    counted = f"{many(len(kept), 'episode')} of {len(outcomes)} kept"
    lines = "\n".join(f"<p>{html.escape(line)}</p>" for line in (*notes, counted))
    return f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>
<style>{_STYLE}</style>
<h1>{html.escape(title)}</h1>
{lines}
<main>
{cards}
</main>
</html>
"""


def number_text(number: float) -> str:
    """Return a number with three digits, or with all before the point if those are more."""
    return f"{number:.3g}" if abs(number) < 999.5 else f"{number:.0f}"


def _card(outcome: Outcome, recording: Recording, tells_agent: bool) -> str:
    """Return the card of an episode."""
    success = outcome.info.get("is_success")
    ending = _OUTCOMES[None if success is None else bool(success)]
    name = f"{outcome.world} · seed {outcome.seed}"
    name = f"{outcome.agent} · {name}" if tells_agent else name
    picture = base64.b64encode(recording.thumbnail).decode()
    page = _link(recording.page)
    figures = {"time": f"{clock_time(recording.seconds)} ({many(recording.steps, 'step')})"}
    found = episode_figures(outcome)
    figures |= {FIGURES[key]: number_text(found[key]) for key in FIGURES if key in found}
    figures.pop(FIGURES["success"], None)
    rows = "\n".join(
        f"<dt>{html.escape(label)}</dt><dd>{html.escape(value)}</dd>"
        for label, value in figures.items()
    )
    again = html.escape(recording.command)
    command = f"<details><summary>run it again</summary><pre>{again}</pre></details>"
    return f"""<article class="{ending}">
<header><h2>{html.escape(name)}</h2><b>{ending}</b></header>
<a href="{page}"><img src="data:image/png;base64,{picture}" width="400" height="240"
alt="{html.escape(f"truth and belief at the end of {name}")}"></a>
<dl>
{rows}
</dl>
<nav><a href="{page}">play it here</a> <a href="{_link(recording.episode)}">episode</a></nav>
{command if again else ""}
</article>"""


def _link(path: Path) -> str:
    """Return the link to a file in the page's folder."""
    return html.escape(quote(path.name))
