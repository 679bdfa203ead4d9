"""The page's section about mappers: a table an odometer; and two of the page's sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from albot_agents.benchmark.folder import CellResults
from albot_agents.benchmark.homing_curve import HomingCurve, fit_curve
from albot_agents.benchmark.mappers import (
    WORLDS,
    MapperRow,
    home_radius,
    make_mapper_table,
)
from albot_agents.benchmark.markdown import FEWEST, paragraph, written
from albot_agents.benchmark.protocol import Protocol
from albot_agents.registry import BY_MAP
from albot_core.mappers.registry import NO_MAPPER

_ENOUGH = 0.9
"""Share of episodes that a mapper must bring home to be named."""
_COLUMNS: Mapping[str, tuple[str, str]] = {
    "success_rate": ("success", "{:.0%}"),
    "spl": ("SPL", "{:.2f}"),
    "carried_rate": ("success if carried", "{:.0%}"),
    "home_error_begin": ("error of home at the beginning (m)", "{:.2f}"),
    "home_error": ("in the end (m)", "{:.2f}"),
    "blur": ("map entropy less the true map's (nats)", "{:+.2f}"),
    "claims_precision": ("precision of claims", "{:.1%}"),
    "claims_recall": ("recall of claims", "{:.0%}"),
    "places_precision": ("precision of places", "{:.1%}"),
    "places_recall": ("recall of places", "{:.0%}"),
}
"""Columns of the table: titles and formats of `MapperRow.figures`."""

_EXPLANATION = (
    "The same agent with each mapper, in the same episodes in random offices: coming home in "
    "`Albot/HomingByMap-v0`, claims of `gap-explorer` in `Albot/Explore-v0`, places of "
    "`place-judge` in `Albot/PlaceRecognition-v0`. The error of home is the distance between where "
    "home is believed and where it is, seen from the robot; medians. In some episodes the robot "
    "was carried before its return; errors, points and curve leave them out. The entropy is that "
    "of all scans as the mapper laid them while exploring, less that of the same scans at the true "
    "poses. In brackets: 95 % intervals."
)


@dataclass(frozen=True, kw_only=True)
class MapperReport:
    """What the section is made of."""

    rows: Sequence[MapperRow] = ()
    """The figures of all mappers (`make_mapper_table`)."""
    curves: Mapping[str, HomingCurve] = field(default_factory=dict)
    """The curve of each driver that has one."""
    costs: Mapping[str, float] = field(default_factory=dict)
    """Cost a reading of mappers, in costs of `odometry`."""
    asked: int = 0
    """Number of episodes that the protocol asks for in a row."""

    @classmethod
    def of(
        cls, results: Iterable[CellResults], protocol: Protocol, costs: Mapping[str, float]
    ) -> MapperReport:
        """Return the report of results, given the costs of mappers."""
        results = list(results)
        rows = make_mapper_table(results, protocol)
        drivers = dict.fromkeys(row.driver for row in rows)
        fits = {driver: fit_curve(results, driver) for driver in drivers}
        curves = {driver: fit for driver, fit in fits.items() if fit is not None}
        asked = len(protocol.keys(BY_MAP, WORLDS))
        return cls(rows=rows, curves=curves, costs=costs, asked=asked)

    @property
    def drivers(self) -> list[str]:
        """The drivers, in the order of the rows."""
        return list(dict.fromkeys(row.driver for row in self.rows))


def sentences(report: MapperReport) -> list[str]:
    """Return what the first driver's figures show, two sentences, as far as they are known.

    Neither is made of fewer than `FEWEST` episodes, each another one of the protocol: the first of
    no row with fewer, the second of no curve over fewer.
    """
    if not report.rows:
        return []
    driver, curve = report.drivers[0], report.curves.get(report.drivers[0])
    rows = [row for row in report.rows if row.driver == driver and row.episodes >= FEWEST]
    found = list(_reached(rows, report.costs)) if rows else []
    if curve is not None and curve.keys >= FEWEST:
        said = [*([_need(driver, curve)] if curve.levels else []), *_failed(curve)]
        text = "; ".join(said)
        found += [f"{text[0].upper()}{text[1:]}."] if said else []
    return found


def _failed(curve: HomingCurve) -> Iterator[str]:
    """Yield how many of the failures were the map's."""
    if curve.failures:
        text = f"of the {curve.failures} failures, {curve.lost / curve.failures:.0%} ended with "
        text += f"home believed more than {home_radius():g} m off: there the map failed"
        yield f"{text}, in the others the driving" if curve.lost < curve.failures else text


def _need(driver: str, curve: HomingCurve) -> str:
    """Return how far off home may be believed."""
    (level, first), *others = (
        (f"{level:.0%}", f"{error.value:.2g} m ({error.ci95[0]:.2g} to {error.ci95[1]:.2g} m)")
        for level, error in curve.levels.items()
    )
    text = f"When home is believed {first} off as the return begins, `{driver}` comes home in "
    text += f"{level} of the episodes"
    return "".join([text, *(f", and in {some} when it is {off} off" for some, off in others)])


def _reached(rows: Sequence[MapperRow], costs: Mapping[str, float]) -> Iterator[str]:
    """Yield which mappers bring the driver home, with the first odometer of its rows."""
    odometer = rows[0].odometer
    rates = {
        row.mapper: row.figures["success_rate"].value for row in rows if row.odometer == odometer
    }
    without = rates.pop(NO_MAPPER, None)
    if not rates:
        return
    good = sorted((name for name in rates if rates[name] >= _ENOUGH), key=lambda name: -rates[name])
    text = f"With the odometer `{odometer}`, {len(good)} of {len(rates)} mappers bring "
    text += f"`{rows[0].driver}` home in "
    text += f"{_ENOUGH:.0%} or more"
    if good:
        text += f" ({', '.join(f'`{name}`' for name in good)}"
        priced = [name for name in good if name in costs]
        if priced:
            cheap = min(priced, key=lambda name: costs[name])
            text += f"; `{cheap}` is the cheapest of them, at {_times(costs[cheap])} times the "
            text += "cost of `odometry`"
        text += ")"
    else:
        best = max(rates, key=lambda name: rates[name])
        text += f"; the best, `{best}`, does in {rates[best]:.0%}"
    yield text + ("." if without is None else f"; without a mapper it is {without:.0%}.")


def cost_text(costs: Mapping[str, float], mapper: str) -> str:
    """Return the cost of a mapper in words; a dash if it is not known."""
    return _times(costs[mapper]) if mapper in costs else "–"


def _times(cost: float) -> str:
    """Return a cost in words: with one decimal below 10."""
    return f"{cost:.1f}" if cost < 9.95 else f"{cost:,.0f}"


def mapper_section(report: MapperReport) -> Iterator[str]:
    """Yield the lines of the section; none without rows."""
    if not report.rows:
        return
    yield "## Mappers"
    yield from paragraph(_EXPLANATION)
    for driver in report.drivers:
        rows = [row for row in report.rows if row.driver == driver]
        for odometer in dict.fromkeys(row.odometer for row in rows):
            yield ""
            yield f"Driver `{driver}`, odometer `{odometer}`:"
            yield ""
            yield from _table(report, [row for row in rows if row.odometer == odometer])


def mapper_data(report: MapperReport) -> dict[str, Any]:
    """Return what the section shows as plain data, for programs."""
    return {
        "rows": [asdict(row) for row in report.rows],
        "costs": dict(report.costs),
        "curves": {
            driver: {
                "intercept": curve.fit.intercept,
                "slope": curve.fit.slope,
                "levels": {f"{level:g}": asdict(found) for level, found in curve.levels.items()},
                "bins": [asdict(some) for some in curve.bins],
                "episodes": len(curve.errors),
                "failures": curve.failures,
                "lost": curve.lost,
            }
            for driver, curve in report.curves.items()
        },
    }


def _table(report: MapperReport, rows: Sequence[MapperRow]) -> Iterator[str]:
    costs = report.costs
    names = [name for name in _COLUMNS if any(name in row.figures for row in rows)]
    titles = [_COLUMNS[name][0] for name in names]
    if priced := any(row.mapper in costs for row in rows):
        titles.append("cost a reading (× `odometry`)")
    yield f"| mapper | {' | '.join(titles)} | episodes: home · claims · places |"
    yield "|---" * (len(titles) + 2) + "|"
    for row in rows:
        # One episode is not resampled; rates have Wilson's interval.
        cells = [
            written(
                row.figures.get(name),
                _COLUMNS[name][1],
                interval=row.episodes > 1 or name.endswith("_rate"),
            )
            for name in names
        ]
        if priced:
            cells.append(cost_text(costs, row.mapper))
        counts = (row.episodes, row.claims, row.places)
        numbers = [f"{count}" if count >= report.asked else f"**{count}**" for count in counts]
        yield f"| `{row.mapper}` | {' | '.join(cells)} | {' · '.join(numbers)} |"
