"""The analysis of a game for a terminal."""

from __future__ import annotations

from app.analysis.model import GameAnalysis, SideAnalysis
from hardware.piece_set import Colour


def analysis_text(game: GameAnalysis) -> str:
    """Players, opening, accuracy of both sides, and a line for each mistake."""
    names = {Colour.WHITE: game.white, Colour.BLACK: game.black}
    searched = f"{game.nodes} nodes" if game.nodes is not None else f"{game.move_time_s:g} s"
    lines = [f"{game.white} - {game.black}  {game.result}   ({game.engine}, {searched} a position)"]
    if game.opening is not None:
        lines.append(f"  {game.opening.eco} {game.opening.name}, up to ply {game.opening.plies}")
    width = max(map(len, names.values()))
    lines += [f"  {names[colour]:<{width}}  {_side(game.sides[colour])}" for colour in Colour]
    for move in game.moves:
        if move.judgement is not None:
            lines.append(f"  {move.number}{'.' if move.side is Colour.WHITE else '…'} {move.note}")
    return "\n".join(lines)


def _side(side: SideAnalysis) -> str:
    if side.accuracy is None:
        return "has not moved"
    counted = (
        (side.inaccuracies, "inaccurac", "y", "ies"),
        (side.mistakes, "mistake", "", "s"),
        (side.blunders, "blunder", "", "s"),
    )
    said = ", ".join(f"{count} {word}{one if count == 1 else many}" for count, word, one, many in counted)
    return f"accuracy {side.accuracy:.0f} %, {said}"
