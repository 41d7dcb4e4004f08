"""What an engine thinks of a game that was analysed: winning chances, accuracy, and its mistakes with their reasons."""

from __future__ import annotations

from typing import Final

from app.analysis.judgement import Judgement
from app.analysis.model import AnalysedMove, GameAnalysis, SideAnalysis
from app.report.figures_of_plies import Chart, DataTable
from app.report.markup import Html, joined, tag
from app.report.parts import figure
from app.report.plot import PlotArea, drawing, mark, nice_ticks
from app.report.source import ReportSource
from hardware.piece_set import Colour

_SIZES: Final = {Judgement.INACCURACY: 3.2, Judgement.MISTAKE: 4.2, Judgement.BLUNDER: 5.2}
"""Of a mark: what is worse is larger, for those who see no colours."""
_QUARTERS: Final = (0.0, 25.0, 50.0, 75.0, 100.0)
_PLURALS: Final = {
    Judgement.INACCURACY: "inaccuracies", Judgement.MISTAKE: "mistakes", Judgement.BLUNDER: "blunders",
}  # fmt: skip


def analysis_of_game(source: ReportSource) -> Html | None:
    """The part of the page; None: nobody has analysed the game."""
    analysis = source.analysis
    if analysis is None or not analysis.moves:
        return None
    judged = [move for move in analysis.moves if move.judgement is not None]
    parts = [_lead(analysis), tag("div", figure(_chances(analysis, judged)), class_="charts")]
    if judged:
        parts.append(tag("ol", *map(_judged, judged), class_="incidents"))
    return joined(parts)


def move_name(move: AnalysedMove) -> str:
    """Such as ``12… Nf6``."""
    return f"{move.number}{'.' if move.side is Colour.WHITE else '…'} {move.san}"


def _lead(analysis: GameAnalysis) -> Html:
    searched = f"{analysis.nodes} nodes" if analysis.nodes is not None else f"{analysis.move_time_s:g} s"
    facts = [] if analysis.opening is None else [("Opening", f"{analysis.opening.eco} {analysis.opening.name}")]
    facts += [(f"{colour.value.capitalize()} played", _side(analysis.sides[colour])) for colour in Colour]
    facts.append(("Evaluated by", f"{analysis.engine}, {searched} a position"))
    return tag("dl", *(tag("div", tag("dt", name), tag("dd", value)) for name, value in facts))


def _side(side: SideAnalysis) -> str:
    if side.accuracy is None:
        return "no move"
    counts = {
        Judgement.INACCURACY: side.inaccuracies, Judgement.MISTAKE: side.mistakes, Judgement.BLUNDER: side.blunders
    }  # fmt: skip
    said = ", ".join(
        f"{count} {name.value if count == 1 else _PLURALS[name]}" for name, count in counts.items() if count
    )
    return f"{side.accuracy:.0f} % accurate" + (f": {said}" if said else "")


def _judged(move: AnalysedMove) -> Html:
    when = f"{move_name(move)} · {move.lost:.0f} % of winning chances lost"
    look = "wrong" if move.judgement is Judgement.BLUNDER else None
    return tag("li", tag("span", when, class_="when"), move.note, class_=look)


def _chances(analysis: GameAnalysis, judged: list[AnalysedMove]) -> Chart:
    moves = analysis.moves
    points = [(0.0, analysis.start_white_wins), *((float(move.ply), move.white_wins) for move in moves)]
    ticks = nice_ticks(0.0, float(len(moves)))
    area = PlotArea(tuple(tick for tick in ticks if tick == round(tick)) or ticks, _QUARTERS)
    half = area.y(50.0)
    parts = [
        area.axes("ply", "White’s chances [%]"),
        tag("line", x1=area.x(area.x_ticks[0]), y1=half, x2=area.x(area.x_ticks[-1]), y2=half, class_="axis"),
        area.line(points, "one"),
    ]
    for move in judged:
        assert move.judgement is not None
        says = f"ply {move.ply}, {move_name(move)}: {move.note}"
        at = area.x(float(move.ply)), area.y(move.white_wins)
        parts.append(mark(None, *at, says, _SIZES[move.judgement], f"j-{move.judgement.value}"))
    rows = [
        (
            str(move.ply), move_name(move), move.score or "", f"{move.white_wins:.0f}", f"{move.accuracy:.0f}",
            move.judgement or "", " ".join(move.lines[0].moves) if move.lines else "",
        )
        for move in moves
    ]  # fmt: skip
    columns = ("ply", "move", ">score", ">White’s chances [%]", ">accuracy [%]", "judged", "best line instead")
    counted = ", ".join(
        f"{sum(move.judgement is name for move in judged)} {plural}" for name, plural in _PLURALS.items()
    )
    return Chart(
        "Winning chances",
        "White’s winning chances after each ply, by the engine’s evaluation and the curve that Lichess publishes; "
        "marked are moves that gave away 5, 10 or 15 % and more.",
        joined([drawing("chances", "Winning chances", f"{len(moves)} plies; {counted}.", *parts), _key(judged)]),
        DataTable(columns, rows).html("Every move with its evaluation and the best line instead"),
        wide=True,
    )


def _key(judged: list[AnalysedMove]) -> Html:
    kinds = [name for name in Judgement if any(move.judgement is name for move in judged)]
    if not kinds:
        return Html("")
    return tag("p", *(
        tag("span", tag("svg", mark(None, 7.0, 7.0, kind.value, _SIZES[kind], f"j-{kind.value}"),
                        viewBox="0 0 14 14", aria_hidden="true"), kind.value)
        for kind in kinds
    ), class_="key")  # fmt: skip
