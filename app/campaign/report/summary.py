"""What a campaign's report found, for programs: one object of plain values; what is no number is null."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from app.campaign.report.analysis.comparing import MetricChange, known
from app.campaign.report.analysis.distributions import QUANTILES, Distribution, share_beyond, worst_game
from app.campaign.report.analysis.explaining import Association
from app.campaign.report.charts import bars_of
from app.campaign.report.findings import CampaignComparison, CampaignFindings
from app.campaign.report.page import repeat_command
from app.campaign.report.sentences import all_sentences


def summary_json(found: CampaignFindings) -> str:
    """The whole as JSON."""
    return json.dumps(_plain(_whole(found)), indent=2, ensure_ascii=False, allow_nan=False)


def _whole(found: CampaignFindings) -> Mapping[str, Any]:
    rows = found.rows
    return {
        "campaign": rows.name,
        "games": len(rows.games),
        "games_wanted": rows.wanted,
        "plies": len(rows.plies),
        "holds": found.holds,
        "said": all_sentences(found),
        "rates": {
            rate.outcome: {"games": rate.hits, "low": rate.bounds.low, "high": rate.bounds.high,
                           "at_most": rate.at_most}
            for rate in found.rates
        },
        "figures": {one.figure.key: _figure(one, found) for one in found.distributions},
        "explains_failures": [_association(one) for one in found.explains_failures],
        "explains_mending": [_association(one) for one in found.explains_mending],
        "failures": [
            {"seed": one.seed, "outcome": one.outcome, "reason": one.reason, "said": one.said,
             "folder": one.folder or None, "repeat": repeat_command(rows.name, one.seed)}
            for one in found.failures
        ],
        "throughput": [
            {"host": one.host, "cpu": one.cpu, "games": one.games, "games_an_hour_and_core": one.games_an_hour,
             "speed": one.speed}
            for one in found.throughput
        ],
        "comparison": None if found.comparison is None else _comparison(found.comparison),
        "gate": None if found.verdicts is None else [
            {"bar": one.bar, "held": one.held, "said": one.sentence} for one in found.verdicts
        ],
    }  # fmt: skip


def _figure(one: Distribution, found: CampaignFindings) -> Mapping[str, Any]:
    seed, ply = worst_game(one, found.rows)
    bars = []
    for bar in bars_of(one.figure, found):
        if bar.counted:
            beyond = share_beyond(one, found.rows, bar)
            bars.append({"bar": bar.value, "said": bar.says, "beyond": beyond.hits, "of": beyond.trials,
                         "share_at_most": beyond.at_most, "confidence": bar.confidence})  # fmt: skip
    return {
        "unit": one.figure.unit,
        "values": one.values.size,
        "quantiles": {f"{share:g}": one.quantile(share) for share in QUANTILES},
        "largest": {"value": one.most, "seed": seed, "ply": ply},
        "bars": bars,
    }


def _association(one: Association) -> Mapping[str, Any]:
    groups = [{"group": group.label, "games": group.games, "value": group.value} for group in one.groups]
    return {"range": one.name, "p": one.p, "p_corrected": one.corrected, "holds": one.holds,
            "most_in": one.standing_out.label, "both_ends": one.both_ends, "groups": groups}  # fmt: skip


def _comparison(comparison: CampaignComparison) -> Mapping[str, Any]:
    match = comparison.match
    return {
        "older": match.older.name,
        "paired": match.paired,
        "games": len(match.newer.games),
        "left_out": match.left_out,
        "alike_to_the_last_bit": match.alike,
        "differences": None if comparison.differences is None else list(comparison.differences),
        "metrics": [_change(change) for change in comparison.changes],
        "nothing_differs_in": [metric.key for metric in comparison.same],
    }


def _change(change: MetricChange) -> Mapping[str, Any]:
    return {
        "metric": change.metric.key,
        "unit": change.metric.unit,
        "found": change.found,
        "worse": change.worse if change.found else None,
        "before": float(known(change.older).mean()),
        "now": float(known(change.newer).mean()),
        "difference": change.estimate.value,
        "low": change.estimate.low,
        "high": change.estimate.high,
        "p": change.p,
        "p_corrected": change.corrected,
        "visible_at_80_percent_power": change.visible,
        "where": [_association(one) for one in change.where],
    }


def _plain(value: Any) -> Any:
    """The same with null for what is no number."""
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
