"""Every state of the page that somebody meets, for a look at it and for axe: who opens it, and what has happened."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import chess
from playwright.sync_api import expect

from app.terminal.shown import RemoteShown
from hardware.piece_set import Colour
from tests.app.page.browsers import Visitor
from tests.app.page.stage import Stage

OPENING = ("e2e4", "d7d5", "e4d5", "d8d5", "b1c3", "d5a5")
PROMOTING = "8/P6k/8/8/8/8/r7/4K3 w - - 0 1"
CHECKED = "rnb1kbnr/pppp1ppp/8/4p3/4P2q/5N2/PPPP2PP/RNBQKB1R w KQkq - 2 3"

Scene = Callable[[Stage, Visitor], None]


def played(stage: Stage, *moves: str) -> None:
    """Moves are made, and told to whoever watches: what is said next comes after them."""
    for move in moves:
        stage.game.arm_moves(chess.Move.from_uci(move))
    stage.game_section(len(stage.game.board.move_stack))


def my_turn(stage: Stage) -> None:
    """The person is asked for a move."""
    stage.game.publisher.prompt("White to move (4:41 - 5:00): your move", turn=True)


def lifted(stage: Stage, visitor: Visitor) -> None:
    """Their move; a piece is lifted."""
    played(stage, *OPENING)
    my_turn(stage)
    expect(visitor.page.locator("#ask")).to_have_attribute("data-mood", "turn")
    visitor.click("d2")
    expect(visitor.page.locator("#board square.move-dest")).to_have_count(2)


def pending(stage: Stage, visitor: Visitor) -> None:
    """A move has been sent; the hand makes it."""
    my_turn(stage)
    expect(visitor.page.locator("#ask")).to_have_attribute("data-mood", "turn")
    visitor.click("g1", "f3")
    expect(visitor.page.locator("#board square.pending")).to_have_count(2)
    stage.game.publisher.answered()
    stage.game.publisher.heard("g1f3")
    stage.game.publisher.phase("your hand plays Nf3")
    expect(visitor.page.locator("#board square.pending")).to_have_count(2)
    expect(visitor.page.locator("#ask .ask-title")).to_have_text("Your hand plays Nf3")


def elsewhere(stage: Stage, *words: str) -> None:
    """Somebody elsewhere has Black, and these words make sense."""
    stage.game.publisher.remote(RemoteShown("anna (1650)", Colour.BLACK, words))


def offered(stage: Stage, visitor: Visitor) -> None:
    """Their opponent elsewhere proposes a draw."""
    played(stage, *OPENING[:2])
    stage.game.publisher.say("anna (1650) proposes a draw: say 'draw' to accept, or 'decline'")
    elsewhere(stage, "draw", "takeback", "decline", "resign", "quit", "help", "look", "fix")
    my_turn(stage)
    expect(visitor.page.locator("#ask [data-answer=decline]")).to_be_visible()
    expect(visitor.page.locator("#actions [data-word=decline]")).to_be_visible()


def deserted(stage: Stage, visitor: Visitor) -> None:
    """Their opponent elsewhere has left in its own turn."""
    played(stage, *OPENING[:3])
    stage.put(clock={"white": 871.2, "black": 14.6, "running": "black", "age": 0.0})
    stage.game.publisher.phase("Black thinks: anna (1650)")
    stage.game.publisher.say("anna (1650) has left the game; say 'claim' to win it")
    elsewhere(stage, "draw", "takeback", "resign", "claim", "quit", "help", "fix")
    expect(visitor.page.locator("#ask [data-answer=claim]")).to_be_visible()
    expect(visitor.page.locator("#actions [data-word=claim]")).to_be_visible()


def rematch(stage: Stage, visitor: Visitor) -> None:
    """A game against somebody elsewhere has ended, and they are asked what is next."""
    played(stage, "f2f3", "e7e5", "g2g4", "d8h4")
    stage.game.record.end("0-1", "checkmate", stage.game.plant)
    elsewhere(stage, "quit")
    question = "checkmate, result 0-1: say 'rematch', 'new' for another opponent, or 'quit'"
    stage.game.publisher.prompt(question, ("rematch", "new", "quit"))
    expect(visitor.page.get_by_role("button", name="Rematch")).to_be_visible()


def at_work(stage: Stage, visitor: Visitor) -> None:
    """The arm plays."""
    played(stage, *OPENING[:3])
    stage.game.publisher.phase("Qxd5: carry black pawn, d5 to R3")
    expect(visitor.page.locator("#phase-text")).to_contain_text("Qxd5")
    expect(visitor.page.locator("#moves button.move")).to_have_count(3)


def question(stage: Stage, visitor: Visitor) -> None:
    """Vision is not sure of a move."""
    played(stage, *OPENING)
    stage.game.publisher.prompt(
        "this looks like Nf3, but not clearly: was that it? (yes or no)", ("yes", "no"), ("g1", "f3")
    )
    expect(visitor.page.get_by_role("button", name="Yes")).to_be_visible()


def mending(stage: Stage, visitor: Visitor) -> None:
    """The robot needs a hand."""
    played(stage, *OPENING)
    stage.game.publisher.heard("fix")
    stage.game.publisher.say(
        "the white knight of c3 lies between c3 and d4, where no finger reaches it. Put it right by 'hand move …' and "
        "say 'done'", ("c3", "d4"),
    )  # fmt: skip
    stage.game.publisher.prompt("done?", ("done",), ("c3", "d4"))
    expect(visitor.page.get_by_role("button", name="Done")).to_be_visible()


def promotion(stage: Stage, visitor: Visitor) -> None:
    """A pawn arrives."""
    my_turn(stage)
    expect(visitor.page.locator("#ask")).to_have_attribute("data-mood", "turn")
    visitor.click("a7", "a8")
    expect(visitor.page.locator("dialog.promotion")).to_be_visible()


def earlier(stage: Stage, visitor: Visitor) -> None:
    """They look at an earlier position."""
    played(stage, *OPENING)
    expect(visitor.page.locator("#moves button.move")).to_have_count(len(OPENING))
    visitor.page.locator("#moves button.move").nth(2).click()
    expect(visitor.page.get_by_role("button", name="Back to the game")).to_be_visible()


def in_check(stage: Stage, visitor: Visitor) -> None:
    """The person is in check, short of time, and sees the evaluation."""
    visitor.page.evaluate("localStorage.setItem('touchmove.evaluation', 'true')")
    visitor.page.reload()
    my_turn(stage)
    stage.put(clock={"white": 14.6, "black": 3700.0, "running": "white", "age": 0.0})
    expect(visitor.page.locator("#near .clock.low")).to_be_visible()
    expect(visitor.page.locator("#board square.check")).to_have_count(1)
    expect(visitor.page.locator("#evaluation")).to_be_visible()


def over(stage: Stage, visitor: Visitor) -> None:
    """The game has ended."""
    played(stage, "f2f3", "e7e5", "g2g4", "d8h4")
    stage.game.record.end("0-1", "checkmate", stage.game.plant)
    expect(visitor.page.locator("#ask[data-mood=over]")).to_be_visible()


def stopped(stage: Stage, visitor: Visitor) -> None:
    """STOP was pressed."""
    played(stage, "e2e4")
    stage.game.publisher.phase("e5: carry black pawn, e7 to e5")
    visitor.page.locator("#stop").click()
    expect(visitor.page.get_by_role("button", name="Continue")).to_be_visible()


def lost(stage: Stage, visitor: Visitor) -> None:
    """The connection is lost."""
    played(stage, "e2e4")
    my_turn(stage)
    expect(visitor.page.locator("#moves button.move")).to_have_count(1)
    visitor.cut()
    expect(visitor.page.locator("[data-banner=connection]")).to_be_visible()


def ended(stage: Stage, visitor: Visitor) -> None:
    """The program has ended."""
    played(stage, "e2e4", "e7e5")
    stage.game.publisher.end("you have left the game: 'touchmove resume' continues it")
    expect(visitor.page.locator("#ask .ask-title")).to_have_text("The program has ended")


def watching(stage: Stage, visitor: Visitor) -> None:
    """Somebody else holds the controls, and is asked for them."""
    played(stage, "e2e4")
    stage.put(controls={"you": 2, "holder": 1, "watchers": 5, "asking": 2, "stoppable": True})
    expect(visitor.page.locator("#open-controls")).to_have_attribute("data-role", "watcher")
    visitor.page.locator("#open-controls").click()
    expect(visitor.page.locator("dialog")).to_be_visible()


def asked(stage: Stage, visitor: Visitor) -> None:
    """Somebody asks for the controls; a device is not well; more is unfolded."""
    played(stage, "e2e4")
    my_turn(stage)
    stage.game.publisher.device("camera", False, "no picture for 2.1 s: look at its cable")
    stage.put(controls={"you": 1, "holder": 1, "watchers": 2, "asking": 2, "stoppable": True})
    expect(visitor.page.locator("[data-banner=asked]")).to_be_visible()
    visitor.page.locator(".more summary").click()
    expect(visitor.page.locator("[data-hand=knock]")).to_be_visible()


def new_game(stage: Stage, visitor: Visitor) -> None:
    """The dialog for a new game, all unfolded."""
    played(stage, "e2e4")
    my_turn(stage)
    visitor.page.locator("[data-word=new]").click()
    visitor.page.get_by_role("radio", name="Other", exact=True).check()
    visitor.page.get_by_role("radio", name="Another", exact=True).check()
    expect(visitor.page.locator("#new-fen")).to_be_visible()


def editor(stage: Stage, visitor: Visitor) -> None:
    """The editor."""
    my_turn(stage)
    visitor.page.locator(".more summary").click()
    visitor.page.locator("[data-word=setup]").click()
    visitor.page.get_by_role("button", name="white queen").click()
    expect(visitor.page.locator(".editor .grid")).to_be_visible()


def settings(stage: Stage, visitor: Visitor) -> None:
    """The settings."""
    visitor.page.locator("#open-settings").click()
    expect(visitor.page.locator("[data-dialog=settings]")).to_be_visible()


def games(stage: Stage, visitor: Visitor) -> None:
    """The recorded games."""
    played(stage, "e2e4", "e7e5")
    visitor.page.locator("#open-games").click()
    expect(visitor.page.locator(".games .game")).to_have_count(1)


def resigning(stage: Stage, visitor: Visitor) -> None:
    """They are asked whether they mean it."""
    my_turn(stage)
    visitor.page.locator("[data-word=resign]").click()
    expect(visitor.page.locator("[data-dialog=confirm]")).to_be_visible()


SCENES: Mapping[str, tuple[Scene, str]] = {
    scene.__name__: (scene, fen)
    for scene, fen in (
        (lifted, chess.STARTING_FEN), (pending, chess.STARTING_FEN), (at_work, chess.STARTING_FEN),
        (question, chess.STARTING_FEN), (mending, chess.STARTING_FEN), (promotion, PROMOTING),
        (earlier, chess.STARTING_FEN), (in_check, CHECKED), (over, chess.STARTING_FEN), (stopped, chess.STARTING_FEN),
        (lost, chess.STARTING_FEN), (ended, chess.STARTING_FEN), (watching, chess.STARTING_FEN),
        (asked, chess.STARTING_FEN), (new_game, chess.STARTING_FEN), (editor, chess.STARTING_FEN),
        (settings, chess.STARTING_FEN), (games, chess.STARTING_FEN), (resigning, chess.STARTING_FEN),
        (offered, chess.STARTING_FEN), (deserted, chess.STARTING_FEN), (rematch, chess.STARTING_FEN),
    )
}  # fmt: skip
"""By name: the scene, and the position that its game begins with."""
