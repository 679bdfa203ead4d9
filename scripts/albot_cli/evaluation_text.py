"""The figures of an evaluation as text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from albot_core.counts import many


def evaluation_text(facts: dict[str, Any]) -> str:
    """Return the figures as text."""
    lines = [
        f"{facts['agent']} in {facts['task']}, {many(facts['episodes'], 'episode')}, mapper "
        f"{facts['mapper']}, odometer {facts['odometer']}, {facts['seconds']:.0f} s"
        + (", stopped before the end" if facts["stopped"] else "")
    ]
    if facts["success_rate"] is not None:
        low, high = facts["ci95"]
        lines.append(f"  success   {facts['success_rate']:.0%}  (95 %: {low:.0%} to {high:.0%})")
    if facts["spl"] is not None:
        spl_low, spl_high = facts["spl_ci95"]
        lines.append(
            f"  SPL       {facts['spl']:.2f}  (95 %: {spl_low:.2f} to {spl_high:.2f}), "
            f"median {facts['spl_median']:.2f}, soft {facts['soft_spl']:.2f}"
        )
    if facts["mean_final_distance_m"] is not None:
        began = facts["mean_initial_distance_m"]
        lines.append(
            f"  from home {facts['mean_final_distance_m']:.1f} m at the end"
            + ("" if began is None else f", {began:.1f} m at the beginning")
        )
    if facts["revisits"] is not None:
        lines.append(f"  places    {recall_text(facts)}")
    if facts["mean_coverage"] is not None:
        lines.append(
            f"  covered   {facts['mean_coverage']:.0%} of the ground; "
            f"{facts['collisions_per_m'] or 0:.3f} collisions a metre"
        )
    if facts["coverage_auc"] is not None:
        low, high = facts["coverage_auc_ci95"]
        far, all_of = facts["coverage_episodes"], facts["episodes"]
        lines.append(
            f"  exploring {facts['coverage_auc']:.3f} covered on average over the first 200 m  "
            f"(95 %: {low:.3f} to {high:.3f})"
            + ("" if far == all_of else f", which {far} of {many(all_of, 'episode')} drove")
        )
    elif facts["mean_coverage"] is not None:
        lines.append("  exploring nothing to average: no episode drove 200 m")
    if facts["rooms_share"] is not None:
        low, high = facts["rooms_share_ci95"]
        lines.append(
            f"  rooms     {facts['rooms_share']:.0%} entered  (95 %: {low:.0%} to {high:.0%})"
        )
    if facts["against"] is not None:
        lines += _differences(facts["against"])
    lines += [f"  {name:<9} {path}" for name, path in facts["files"].items()]
    return "\n".join(lines)


def recall_text(facts: Mapping[str, Any]) -> str:
    """Return recall and precision of place recognition as text."""
    recall, precision = (
        "–" if facts[name] is None else f"{facts[name]:.3f}" for name in ("recall", "precision")
    )
    if not facts["revisits"]:
        claims = "" if facts["precision"] is None else f"; precision {precision}"
        return f"no recall: no place was seen again{claims}"
    return f"recall {recall} at precision {precision}, of {facts['revisits']} seen again"


def _differences(against: dict[str, Any]) -> list[str]:
    """Return the differences from the other agent as lines of text."""
    from albot_agents.evaluation.paired import FIGURES

    lines = [f"  less {against['agent']}, mapper {against['mapper']}, in the same episodes:"]
    for name, found in against["differences"].items():
        low, high = found["ci95"]
        lines.append(
            f"    {FIGURES[name]:<19}{found['mean']:+.3f}  (95 %: {low:+.3f} to {high:+.3f}); "
            f"larger in {found['larger']}, smaller in {found['smaller']}, "
            f"equal in {found['equal']}"
        )
    return lines
