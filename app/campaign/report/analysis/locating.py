"""Where a change between two campaigns sits: in which range, kind of ply or piece it is another than elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import chess
import numpy as np
from numpy.typing import NDArray

from app.campaign.report.analysis.comparing import GameMatch, MetricChange, figure_test, known
from app.campaign.report.analysis.conditions import drawn_ranges
from app.campaign.report.analysis.explaining import (
    Association,
    GroupFigure,
    corrected,
    explained,
    of_groups,
    where_a_change_sits,
)
from app.campaign.report.analysis.metrics import Metric, MetricSort, mean_by_game
from app.campaign.report.analysis.rows import CampaignRows, Words
from app.campaign.report.analysis.statistics import Flags, Numbers

KIND_OF_PLY: Final = "the kind of ply"
PIECE: Final = "the piece"


def located(change: MetricChange, match: GameMatch) -> tuple[Association, ...]:
    """In which ranges, kinds of plies and pieces a change differs from group to group, the surest first.

    Args:
        change: one that was found.
        match: the games it was found in, with the same plies in both where they are paired.
    """
    return corrected([*_by_range(change, match), *_by_ply(change, match)])


def _by_range(change: MetricChange, match: GameMatch) -> Sequence[Association]:
    if not match.paired:
        return where_a_change_sits(change.older, change.newer, drawn_ranges(match.older, match.newer), change.sign)
    away = change.newer - change.older
    if change.metric.sort is MetricSort.RATE:
        happened = np.where(np.isnan(away), np.nan, away * change.sign > 0.0)  # unknown is not unchanged
        return explained(happened, drawn_ranges(match.newer))
    return explained(away, drawn_ranges(match.newer), change.sign)


def _by_ply(change: MetricChange, match: GameMatch) -> list[Association]:
    metric = change.metric
    if not metric.of_plies:
        return []
    divisions = [(PIECE, _pieces(match.older), _pieces(match.newer))]
    if metric.kind is None:
        divisions.append((KIND_OF_PLY, match.older.plies.words("kind"), match.newer.plies.words("kind")))
    found = [_division(name, change, match, older, newer) for name, older, newer in divisions]
    return [one for one in found if one is not None]


def _pieces(rows: CampaignRows) -> Words:
    """The name of the piece that each ply moved, None where the row does not say."""
    names = [_piece_name(symbol) for symbol in rows.plies.words("piece")]
    found = np.empty(len(names), dtype=np.object_)
    found[:] = names
    return found


def _piece_name(symbol: str | None) -> str | None:
    if symbol is None or symbol.lower() not in chess.PIECE_SYMBOLS:
        return symbol
    return chess.piece_name(chess.PIECE_SYMBOLS.index(symbol.lower()))


def _division(name: str, change: MetricChange, match: GameMatch, older: Words, newer: Words) -> Association | None:
    """Each level of what plies differ by against the other plies of its game; the best p-value times the levels."""
    groups, p_values = [], []
    levels = sorted({one for one in older if one is not None} & {one for one in newer if one is not None})
    for level in levels:
        sides = (_sides(change.metric, match.older, older == level), _sides(change.metric, match.newer, newer == level))
        inside, rest = _change(sides, 0, match.paired), _change(sides, 1, match.paired)
        against = [within - others for within, others in sides]
        if min(known(one).size for one in (*inside, *rest, *against)) == 0:
            continue
        groups.append(_group(level, inside, rest, match.paired))
        p_values.append(_contrast_p(against[0], against[1], match.paired))
    return of_groups(name, tuple(groups), change.sign, p_values) if len(groups) > 1 else None


def _sides(metric: Metric, rows: CampaignRows, inside: Flags | NDArray[np.object_]) -> tuple[Numbers, Numbers]:
    """Of each game the average of its plies at a level, and of its others."""
    chosen = np.asarray(inside, dtype=np.bool_)
    values, game, games = metric.of_each_ply(rows), rows.game_of_plies(), len(rows.games)
    at_level = mean_by_game(np.where(chosen, values, np.nan), game, games)
    return at_level, mean_by_game(np.where(chosen, np.nan, values), game, games)


def _change(sides: tuple[tuple[Numbers, Numbers], ...], part: int, paired: bool) -> tuple[Numbers, Numbers]:
    """Figures of older and newer games at the level (0) or beside it (1), of pairs those that both have."""
    older, newer = sides[0][part], sides[1][part]
    if paired:
        both = ~np.isnan(older) & ~np.isnan(newer)
        return older[both], newer[both]
    return known(older), known(newer)


def _group(level: str, inside: tuple[Numbers, Numbers], rest: tuple[Numbers, Numbers], paired: bool) -> GroupFigure:
    def games(of: tuple[Numbers, Numbers]) -> int:
        return of[1].size if paired else of[0].size + of[1].size

    def change(of: tuple[Numbers, Numbers]) -> float:
        return float(of[1].mean() - of[0].mean())

    return GroupFigure(level, games(inside), change(inside), games(rest), change(rest))


def _contrast_p(older: Numbers, newer: Numbers, paired: bool) -> float:
    if paired:
        both = ~np.isnan(older) & ~np.isnan(newer)
        older, newer = older[both], newer[both]
    return figure_test(known(older), known(newer), paired)[0]
