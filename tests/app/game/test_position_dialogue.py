"""Which position stands on the board: what is seen, what is asked, and what a person says of it."""

from __future__ import annotations

from collections.abc import Sequence

import chess
import pytest

from app.game.person import GameLeft
from app.game.position_dialogue import PositionDialogue, position_problem
from app.pieces.layout import colour_of, kind_of
from app.players.person import Human, PersonGone
from app.players.typed_commands import said_of_square
from hardware.piece_set import Colour, Kind, Look
from hardware.table import Place, TableSettings, square_place
from tests.app.game.test_person import Hands, Script, UserInterface
from vision.standing.recognised_set import RecognisedPiece, RecognisedSet

TABLE = TableSettings()


class Shown(UserInterface):
    def __init__(self) -> None:
        super().__init__()
        self.boards: list[str] = []

    def position(self, board: chess.Board) -> None:
        self.boards.append(board.board_fen())

    def phase(self, text: str) -> None: ...


def found(
    fen: str, doubts: dict[str, Look] | None = None, lying: Sequence[str] = (), uncertain: Sequence[str] = (),
    between: Sequence[str] = (),
) -> RecognisedSet:  # fmt: skip
    doubts = doubts or {}
    pieces = [
        RecognisedPiece(
            place, TABLE.xy(place), (colour_of(piece.color), kind_of(piece)), doubts.get(chess.square_name(square))
        )
        for square, piece in chess.Board(fen).piece_map().items()
        for place in [square_place(square)]
    ]
    places = [frozenset(map(Place.parse, names)) for names in (lying, between, uncertain)]
    return RecognisedSet(tuple(pieces), *places, frozenset())


def asked(looks: Sequence[RecognisedSet], *lines: str, hands: Hands | None = None) -> tuple[chess.Board, Shown]:
    """What comes of these looks, the last one being repeated, and of what is typed."""
    left, shown = list(looks), Shown()

    def look() -> RecognisedSet:
        return left.pop(0) if len(left) > 1 else left[0]

    dialogue = PositionDialogue(Human(True, Script(*lines), hands), shown, look, TABLE)  # type: ignore[arg-type]
    return dialogue.ask()[0], shown


START = "rnbqkbnr/pppppppp/8/8/8/8/PPPPPPPP/RNBQKBNR"


def test_what_is_sure_is_shown_and_only_the_turn_and_castling_are_asked() -> None:
    board, shown = asked([found(START)], "white", "both", "both")
    assert board.fen() == chess.STARTING_FEN
    assert shown.boards[0] == START
    assert len(shown.asked) == 3


@pytest.mark.parametrize(
    ("fen", "lines", "expected"),
    [
        ("4k3/8/8/8/8/8/8/4K2R", ("black", "short"), "4k3/8/8/8/8/8/8/4K2R b K - 0 1"),
        ("r3k3/8/8/8/8/8/8/4K3", ("white", "no"), "r3k3/8/8/8/8/8/8/4K3 w - - 0 1"),
        # nobody is asked who is in check
        ("4k3/8/8/8/8/8/4r3/4K3", (), "4k3/8/8/8/8/8/4r3/4K3 w - - 0 1"),
        ("4k3/8/8/3pP3/8/8/8/4K3", ("white", "yes"), "4k3/8/8/3pP3/8/8/8/4K3 w - d6 0 1"),
        ("4k3/8/8/3pP3/8/8/8/4K3", ("white", "no"), "4k3/8/8/3pP3/8/8/8/4K3 w - - 0 1"),
        ("4k3/8/8/8/3pP3/8/8/4K3", ("black", "yes"), "4k3/8/8/8/3pP3/8/8/4K3 b - e3 0 1"),
    ],
)
def test_what_nobody_can_see_is_asked(fen: str, lines: tuple[str, ...], expected: str) -> None:
    assert asked([found(fen)], *lines)[0].fen() == expected


def test_doubts_are_asked_by_name_and_answered_by_word() -> None:
    doubts = {"a3": (Colour.WHITE, Kind.BISHOP), "h4": (Colour.WHITE, Kind.PAWN)}
    seen = found("4k3/8/8/8/7p/N7/8/4K3", doubts)
    board, shown = asked([seen], "bishop", "white", "black")
    assert board.fen() == "4k3/8/8/8/7P/B7/8/4K3 b - - 0 1"
    assert "what stands on a3: a white knight or a white bishop?" in shown.asked
    assert "is the pawn on h4 white or black?" in shown.asked


def test_hidden_squares_may_be_empty_or_not() -> None:
    seen = found("4k3/8/8/8/8/8/8/4K3", uncertain=["d3", "e5"])
    assert asked([seen], "nothing", "white")[0].board_fen() == "4k3/8/8/8/8/8/8/4K3"
    board, _ = asked([seen], "e5 black pawn", "nothing", "white")
    assert board.board_fen() == "4k3/8/8/4p3/8/8/8/4K3"


def test_what_lies_or_stands_between_squares_has_to_be_put_right() -> None:
    right = found("4k3/8/8/8/8/8/8/4K2Q")
    for wrong in (found("4k3/8/8/8/8/8/8/4K3", lying=["h1"]), found("4k3/8/8/8/8/8/8/4K2Q", between=["h1"])):
        board, shown = asked([wrong, right], "white", "look", "white")
        assert board.board_fen() == "4k3/8/8/8/8/8/8/4K2Q"
        assert "h1" in shown.asked[0]


def test_impossible_positions_are_named_and_corrected_by_word_or_by_hand() -> None:
    board, shown = asked([found("4k3/8/8/8/8/8/8/8")], "e1 white king", "white")
    assert board.board_fen() == "4k3/8/8/8/8/8/8/4K3"
    assert shown.asked[0].startswith("there is no white king on the board")
    hands = Hands()
    moved = [found("4k3/8/8/8/8/8/8/P3K3"), found("4k3/8/8/8/8/8/P7/4K3")]
    board, shown = asked(moved, "hand move a1 a2", "white", hands=hands)
    assert board.board_fen() == "4k3/8/8/8/8/8/P7/4K3"
    assert "a pawn stands on the first rank or the last" in shown.asked[0]
    assert len(hands.did) == 1


def test_what_was_said_holds_until_the_square_looks_otherwise() -> None:
    first, second = found("4k3/8/8/8/8/8/8/N3K3"), found("4k3/8/8/8/8/8/8/Q3K3")
    board, _ = asked([first, first, second], "a1 white bishop", "look", "white")
    assert board.board_fen() == "4k3/8/8/8/8/8/8/B3K3"
    board, _ = asked([first, second], "a1 white bishop", "look", "white")
    assert board.board_fen() == "4k3/8/8/8/8/8/8/Q3K3"


def test_a_person_can_leave_and_is_told_what_can_be_said() -> None:
    with pytest.raises(GameLeft):
        asked([found(START)], "quit")
    with pytest.raises(PersonGone):
        asked([found(START)], "what?", "help", "hand move e2 e4")
    _, shown = asked([found(START)], "what?", "help", "white", "no", "no")
    assert all("e4 white knight" in one and "look" in one for one in shown.said)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("e4 white knight", (Colour.WHITE, Kind.KNIGHT)), ("e4: a black queen", (Colour.BLACK, Kind.QUEEN)),
        ("e4 = wn", (Colour.WHITE, Kind.KNIGHT)), ("e4 is empty", None), ("e4 nothing", None),
    ],
)  # fmt: skip
def test_squares_are_named_as_people_name_them(words: str, said: Look | None) -> None:
    assert said_of_square(words) == (Place.parse("e4"), said)


@pytest.mark.parametrize("words", ["e4", "e9 white king", "e4 white", "e4 green pawn", "hand move e2 e4", "yes"])
def test_other_words_say_nothing_of_a_square(words: str) -> None:
    assert said_of_square(words) is None


def test_legal_positions_have_no_problem() -> None:
    assert not position_problem(chess.Board())
    board = chess.Board("4k3/8/8/8/8/8/4R3/4K3 w - - 0 1")
    assert position_problem(board) == "the side that does not move is in check"
