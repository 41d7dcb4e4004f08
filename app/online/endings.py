"""How a game on Lichess has ended, in our words."""

from __future__ import annotations

from typing import Final

from app.online.messages import GameState
from app.players.game_end import GameEnd, Result
from hardware.piece_set import Colour

_LOST: Final = {
    "mate": "checkmate",
    "resign": "{loser} resigns",
    "outoftime": "{loser}'s time has run out",
    "timeout": "{loser} has left the game",
    "noStart": "{loser} has not begun",
    "cheat": "{loser} was caught with outside help",
    "variantEnd": "{winner} has won by the variant's rules",
}
_DRAWN: Final = {
    "stalemate": "stalemate",
    "outoftime": "time has run out, and the other side has too little material to mate",
    "timeout": "the opponent has left, and a draw was claimed",
    "insufficientMaterialClaim": "a draw by too little material was claimed",
}
_OPEN: Final = {"aborted": "aborted", "noStart": "nobody has begun", "unknownFinish": "ended by the server"}


def end_of_game(state: GameState) -> GameEnd:
    """The end by the server's word; the state is of a game that is over."""
    if state.winner is not None:
        white = state.winner is Colour.WHITE
        result: Result = "1-0" if white else "0-1"
        names = {"winner": "White" if white else "Black", "loser": "Black" if white else "White"}
        return GameEnd(result, _LOST.get(state.status, "{winner} has won").format(**names), complete=True)
    if state.status in _OPEN:
        return GameEnd("*", _OPEN[state.status], complete=True)
    return GameEnd("1/2-1/2", _DRAWN.get(state.status, "draw"), complete=True)
