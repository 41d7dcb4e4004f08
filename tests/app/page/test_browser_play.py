"""Playing in a browser: pointer, touch and keyboard, questions, new games, and who may do what."""

from __future__ import annotations

import re
import threading
from urllib.parse import urlsplit

import chess
import pytest
from playwright.sync_api import Page, expect

from app.page.web.static_files import StaticFiles
from app.players.typed_commands import NewGame, help_text, parse_command
from app.terminal.shown import RemoteShown
from tests.app.page.browsers import Visit, Visitor
from tests.app.page.conftest import SetStage
from tests.app.page.recorded.recorded_games import RecordedGame
from tests.app.page.scenes import PROMOTING, elsewhere, my_turn, played, rematch
from tests.app.page.stage import Stage
from tests.waiting import PATIENCE, until

pytestmark = pytest.mark.slow


def asked_to_move(stage: Stage, visitor: Visitor) -> None:
    my_turn(stage)
    expect(visitor.page.locator("#ask")).to_have_attribute("data-mood", "turn")


def said(stage: Stage, *lines: str) -> None:
    """Expect that the page has said lines since this was last asked."""
    until(lambda: len(stage.game.lines) >= len(lines))
    assert stage.game.lines == list(lines)
    stage.game.lines.clear()


def button(page: Page, name: str) -> None:
    page.get_by_role("button", name=name, exact=True).click()


# ---------------------------------------------------------------------------------------------------------- the board


def test_a_move_by_click_is_pending_until_it_is_recorded(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    visitor.click("e2")
    expect(visitor.page.locator("#board square.move-dest")).to_have_count(2)
    visitor.click("e4")
    said(stage, "e2e4")
    expect(visitor.page.locator("#board square.pending")).to_have_count(2)
    visitor.cell("e4, white pawn")
    visitor.cell("e2, empty")
    stage.game.publisher.answered()
    played(stage, "e2e4")
    expect(visitor.page.locator("#moves button.move")).to_have_text(["e4"])
    expect(visitor.page.locator("#board square.pending:visible")).to_have_count(0)
    expect(visitor.page.locator("#board square.last-move:visible")).to_have_count(2)
    expect(visitor.page.locator("#announce")).to_have_text(re.compile("White: e4"))


@pytest.mark.parametrize(("rook", "stands"), [("h1", ("g1", "f1")), ("b1", ("c1", "d1"))])
def test_castling_in_chess960_is_pending_as_it_will_stand(
    set_stage: SetStage, visit: Visit, rook: str, stands: tuple[str, str]
) -> None:
    stage = set_stage()
    visitor = visit(stage)
    board = chess.Board("1r3k1r/8/8/8/8/8/8/1R3K1R w HBhb - 0 1", chess960=True)
    legal = {"f1": [board.uci(move)[2:4] for move in board.legal_moves if move.from_square == chess.F1]}
    stage.put(game={**stage.game_section(0), "fen": board.fen(), "chess960": True, "legal": legal})
    visitor.cell("f1, white king")
    asked_to_move(stage, visitor)
    visitor.click("f1", rook)
    said(stage, f"f1{rook}")
    king, beside = stands
    visitor.cell(f"{king}, white king")
    visitor.cell(f"{beside}, white rook")
    visitor.cell(f"{rook}, empty")


def test_a_move_that_was_not_made_is_taken_off_the_board_again(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    visitor.drag("g1", "f3")
    said(stage, "g1f3")
    visitor.cell("f3, white knight")
    stage.game.publisher.say("I do not see g1f3 on the board")
    my_turn(stage)
    visitor.cell("g1, white knight")
    expect(visitor.page.locator("#ask .ask-detail")).to_have_text("I do not see g1f3 on the board")


def test_nobody_moves_out_of_turn_illegally_or_in_an_earlier_position(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    visitor.drag("e2", "e4")  # nothing is asked yet
    asked_to_move(stage, visitor)
    visitor.drag("e2", "e5")
    visitor.drag("e7", "e5")
    played(stage, "e2e4", "e7e5")
    expect(visitor.page.locator("#moves button.move")).to_have_count(2)
    visitor.page.keyboard.press("ArrowLeft")
    expect(visitor.page.get_by_role("button", name="Back to the game")).to_be_visible()
    visitor.drag("d2", "d4")
    visitor.page.keyboard.press("End")
    visitor.drag("d2", "d3")
    said(stage, "d2d3")


def test_who_looks_back_and_takes_back_to_there_is_in_the_game_again(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    played(stage, "e2e4", "e7e5", "g1f3", "b8c6")
    expect(visitor.page.locator("#moves button.move")).to_have_count(4)
    for _ in range(2):
        visitor.page.keyboard.press("ArrowLeft")
    visitor.cell("g1, white knight")
    stage.game.take_back()
    expect(visitor.page.locator("#moves button.move")).to_have_count(2)
    expect(visitor.page.get_by_role("button", name="Back to the game")).to_be_hidden()
    played(stage, "b1c3")
    visitor.cell("c3, white knight")


def test_a_finger_moves_pieces_too(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage, "phone")
    asked_to_move(stage, visitor)
    for square in ("b1", "c3"):
        visitor.page.touchscreen.tap(*visitor.at(square))
    said(stage, "b1c3")


def test_a_board_that_is_seen_is_followed_and_not_dragged(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    stage.put(session={"program": "play", "rig": "lab", "person": "white", "hands": False, "sees": True, "live": True})
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    expect(visitor.page.locator("#ask .ask-detail")).to_contain_text("Welcome")
    visitor.drag("e2", "e4")
    visitor.page.locator("#line").fill("Nf3")
    visitor.page.keyboard.press("Enter")
    said(stage, "Nf3")
    played(stage, "g1f3")
    visitor.cell("f3, white knight")


@pytest.mark.parametrize(("key", "letter"), [("Enter", "q"), ("n", "n"), ("ArrowRight Enter", "n")])
def test_a_promotion_is_chosen(set_stage: SetStage, visit: Visit, key: str, letter: str) -> None:
    stage = set_stage(PROMOTING)
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    visitor.click("a7", "a8")
    expect(visitor.page.get_by_role("button", name="queen", exact=True)).to_be_focused()
    for one in key.split():
        visitor.page.keyboard.press(one)
    said(stage, f"a7a8{letter}")
    visitor.cell("a8, white queen" if letter == "q" else "a8, white knight")


def test_a_promotion_can_be_thought_better_of(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage(PROMOTING)
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    visitor.click("a7", "a8")
    expect(visitor.page.get_by_role("button", name="queen", exact=True)).to_be_focused()
    visitor.page.keyboard.press("Escape")
    visitor.cell("a7, white pawn")
    visitor.click("e1", "d1")
    said(stage, "e1d1")


def test_who_plays_black_sees_the_board_from_there_and_can_flip_it(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    played(stage, "e2e4")
    stage.put(game={**stage.game_section(1), "person": "black"})
    expect(visitor.page.locator("#near .name")).to_have_text("Stockfish 17")
    asked_to_move(stage, visitor)
    x, y = visitor.at("e7", turned=True)
    visitor.page.mouse.click(x, y)
    visitor.page.mouse.click(*visitor.at("e5", turned=True))
    said(stage, "e7e5")
    visitor.page.locator("h1").click()
    visitor.page.keyboard.press("f")
    expect(visitor.page.locator("#near .name")).to_have_text("Human")


# ------------------------------------------------------------------------------------------------------- the keyboard


def test_a_game_by_keyboard_alone(set_stage: SetStage, visit: Visit) -> None:
    """Castling, a promotion, questions, a typed move, a look back and resigning, and not one click."""
    stage = set_stage("7k/P7/8/8/8/8/4P3/R3K3 w Q - 0 1")
    visitor = visit(stage)
    page, keyboard = visitor.page, visitor.page.keyboard
    game = threading.Thread(target=stage.game.play, daemon=True)
    game.start()

    def go_to(square: str) -> None:
        page.locator(".grid [tabindex='0']").first.focus()
        keyboard.press("Control+Home")
        for _ in range("abcdefgh".index(square[0])):
            keyboard.press("ArrowRight")
        for _ in range(8 - int(square[1])):
            keyboard.press("ArrowDown")
        expect(page.locator(f".grid [data-square={square}]")).to_be_focused()

    def settled(plies: int) -> None:
        """The move is recorded and answered; a question about it is answered by the keyboard as well."""
        state = page.locator("#ask[data-mood=turn], #ask[data-mood=ask]")
        while True:
            expect(state).to_have_count(1)
            if state.get_attribute("data-mood") == "ask":
                page.get_by_role("button", name="Yes").focus()
                keyboard.press("Enter")
                expect(page.locator("#ask[data-mood=ask]")).to_have_count(0)
            elif page.locator("#moves button.move").count() >= plies:
                return
            else:
                page.wait_for_timeout(20)

    settled(0)
    go_to("e1")
    keyboard.press("Enter")
    expect(page.locator(".grid [data-square=c1]")).to_have_attribute("aria-label", "c1, empty, can go here")
    keyboard.press("Escape")
    expect(page.locator(".grid [data-square=c1]")).to_have_attribute("aria-label", "c1, empty")
    keyboard.press(" ")
    go_to("c1")
    keyboard.press("Enter")
    settled(2)
    go_to("a7")
    keyboard.press("Enter")
    keyboard.press("ArrowUp")
    keyboard.press("Enter")
    expect(page.get_by_role("button", name="queen", exact=True)).to_be_focused()
    keyboard.press("Enter")
    settled(4)
    page.locator("h1").evaluate("() => document.activeElement.blur()")
    keyboard.press("/")
    expect(page.locator("#line")).to_be_focused()
    keyboard.type("e3")
    keyboard.press("Enter")
    settled(6)
    page.locator("#line").evaluate("(field) => field.blur()")
    keyboard.press("Home")
    visitor.cell("a7, white pawn")
    keyboard.press("End")
    page.locator("[data-word=resign]").focus()
    keyboard.press("Enter")
    expect(page.get_by_role("button", name="Cancel")).to_be_focused()
    keyboard.press("Tab")
    keyboard.press("Enter")
    expect(page.locator("#ask .ask-title")).to_have_text("The program has ended")
    game.join(PATIENCE)
    assert not game.is_alive()
    assert [move.uci() for move in stage.game.board.move_stack][::2] == ["e1c1", "a7a8q", "e2e3"]


def test_what_was_typed_comes_back_with_the_arrow(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    line = visitor.page.locator("#line")
    for text in ("hand knock e4", "help"):
        line.fill(text)
        line.press("Enter")
    said(stage, "hand knock e4", "help")
    line.press("ArrowUp")
    line.press("ArrowUp")
    expect(line).to_have_value("hand knock e4")
    line.press("ArrowDown")
    expect(line).to_have_value("help")


# ---------------------------------------------------------------------------------------------- questions and answers


def test_a_question_is_answered_by_a_button_and_its_squares_are_lit(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    stage.game.publisher.prompt("what has the pawn become? q, r, b or n", ("q", "r", "b", "n"), ("a8", "h8"))
    expect(visitor.page.locator("#ask .ask-title")).to_have_text("What has the pawn become?")
    expect(visitor.page.locator("#board square.lit:visible")).to_have_count(2)
    button(visitor.page, "Rook")
    said(stage, "r")
    stage.game.publisher.answered()
    expect(visitor.page.locator("#board square.lit:visible")).to_have_count(0)


def test_what_a_sentence_tells_one_to_say_has_a_button(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    stage.game.publisher.say(
        "the white pawn of e2 has fallen over. Put it right by hand, or say 'fix' and the arm does it"
    )
    asked_to_move(stage, visitor)
    visitor.page.locator("#ask").get_by_role("button", name="Put right").click()
    said(stage, "fix")


def test_the_simulated_hand_is_told_by_squares(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    visitor.page.locator(".more summary").click()
    button(visitor.page, "Move any piece")
    visitor.click("b1", "b4")
    said(stage, "hand move b1 b4")
    visitor.page.locator(".more summary").click()
    button(visitor.page, "Knock a piece over")
    visitor.page.keyboard.press("Escape")
    visitor.click("e2", "e4")
    said(stage, "e2e4")


def test_a_pause_is_gone_on_from(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    button(visitor.page, "Pause")
    said(stage, "pause")
    stage.game.publisher.say("the clocks are stopped; say 'go' to continue, or 'quit' to leave")
    stage.game.publisher.prompt("go on?", ("go",))
    expect(visitor.page.locator("[data-word=pause]")).to_have_text("Continue")
    visitor.page.locator("#ask").get_by_role("button", name="Continue").click()
    said(stage, "go")


def shown_words(visitor: Visitor) -> list[str]:
    """The words whose buttons can be pressed now, those under 'More' included, in the page's order."""
    return visitor.page.evaluate(
        "[...document.querySelectorAll('#actions [data-word]')]"
        ".filter((one) => !one.hidden && !one.disabled).map((one) => one.dataset.word)"
    )


def test_the_buttons_against_somebody_elsewhere_are_the_words_that_the_game_tells(
    set_stage: SetStage, visit: Visit
) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    page = visitor.page
    for word in ("decline", "claim", "abort"):
        expect(page.locator(f"[data-word={word}]")).to_be_hidden()
    expect(page.locator("[data-word=pause]")).to_be_visible()
    for words in (("abort", "draw", "resign", "quit", "look", "fix", "help"), ("draw", "takeback", "decline", "quit"),
                  ("resign", "claim")):  # fmt: skip
        elsewhere(stage, *words)
        until(lambda words=words: sorted(shown_words(visitor)) == sorted({*words, "flip"} - {"help"}))
    for word in ("pause", "hint", "new", "side", "setup"):
        expect(page.locator(f"[data-word={word}]")).to_be_hidden()
    button(page, "Claim")
    said(stage, "claim")
    elsewhere(stage, "decline", "abort")
    button(page, "Decline")
    said(stage, "decline")
    button(page, "Abort")
    page.locator("dialog").get_by_role("button", name="Abort").click()
    said(stage, "abort")


def test_words_can_be_said_while_somebody_elsewhere_thinks(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    played(stage, "e2e4")
    stage.game.publisher.phase("Black thinks: anna (1650)")
    stage.game.publisher.say("anna (1650) proposes a draw: say 'draw' to accept, or 'decline'")
    elsewhere(stage, "draw", "takeback", "decline", "resign")
    answers = visitor.page.locator("#ask [data-answer]")
    expect(answers).to_have_text(["Draw", "Decline"])
    button(visitor.page, "Take back")
    said(stage, "takeback")
    elsewhere(stage, "draw", "takeback", "resign")  # it stands no more
    expect(answers).to_have_text(["Draw"])


def test_after_a_game_elsewhere_a_rematch_or_another_opponent_is_one_word(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    rematch(stage, visitor)
    visitor.page.locator("#ask [data-answer=new]").click()
    said(stage, "new")
    button(visitor.page, "Rematch")
    said(stage, "rematch")


def test_while_an_opponent_is_looked_for_the_page_says_so(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    played(stage, "f2f3", "e7e5", "g2g4", "d8h4")
    stage.game.record.end("0-1", "checkmate", stage.game.plant)
    expect(visitor.page.locator("#ask[data-mood=over]")).to_be_visible()
    stage.game.publisher.phase("looking for an opponent (15+10, casual); say 'quit' to leave")
    stage.game.publisher.remote(RemoteShown(None, None, ("quit",)))
    expect(visitor.page.locator("#ask .ask-title")).to_contain_text("Looking for an opponent")
    expect(visitor.page.locator("#phase-text")).to_contain_text("Looking for an opponent")
    assert sorted(shown_words(visitor)) == ["flip", "quit"]


def test_where_no_arm_can_be_stopped_the_head_offers_a_pause_only_for_clocks_that_stand_here(
    set_stage: SetStage, visit: Visit
) -> None:
    stage = set_stage(stoppable=False)
    visitor = visit(stage)
    expect(visitor.page.locator("#stop-text")).to_have_text("Pause")
    elsewhere(stage, "draw", "resign")
    expect(visitor.page.locator("#stop")).to_be_hidden()
    visitor.page.keyboard.press("Escape")
    visitor.page.keyboard.press("Escape")
    button(visitor.page, "Draw")
    said(stage, "draw")


def test_a_clock_stands_while_its_delay_lasts(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    clock = {"white": 100.0, "black": 90.0, "running": "white", "age": 3.0}
    stage.put(clock={**clock, "free": 1e6})
    expect(visitor.page.locator("#near .clock")).to_have_text("1:40")
    stage.put(clock={**clock, "free": 0.0})
    expect(visitor.page.locator("#near .clock")).not_to_have_text("1:40")


def test_what_takes_many_lines_is_read_in_the_log(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    stage.game.publisher.say(help_text())
    asked_to_move(stage, visitor)
    expect(visitor.page.locator("#ask .ask-detail")).to_have_text("You play White")
    lines = visitor.page.locator("#log li.say .words").last.inner_text().splitlines()
    assert len(lines) >= len(help_text().splitlines())


def test_between_people_nothing_is_given_away(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage, scripts=("localStorage.setItem('touchmove.evaluation', 'true')",))
    played(stage, "e2e4")
    asked_to_move(stage, visitor)
    expect(visitor.page.locator("#evaluation")).to_be_visible()
    expect(visitor.page.locator("[data-word=hint]")).to_be_visible()
    stage.put(game={**stage.game_section(1), "assists": False})
    expect(visitor.page.locator("#evaluation")).to_be_hidden()
    expect(visitor.page.locator("[data-word=hint]")).to_be_hidden()
    visitor.page.locator("#open-settings").click()
    expect(visitor.page.get_by_role("switch", name="Evaluation bar")).to_be_disabled()


# ----------------------------------------------------------------------------------------------------------- new games


def begun(stage: Stage, line: str, wish: NewGame) -> None:
    """Expect that a line was said that the game understands as a wish."""
    said(stage, line)
    assert parse_command(line, chess.Board()) == wish


def test_a_new_game_is_one_line(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    page = visitor.page
    page.locator("[data-word=new]").click()
    page.get_by_role("radio", name="Black").check()
    page.get_by_role("switch", name="Full strength").uncheck()
    page.get_by_role("slider", name="Elo").fill("1500")
    page.get_by_role("radio", name="5+3").check()
    button(page, "Begin")
    begun(stage, "new black elo 1500 clock 5+3 fen start", NewGame(chess.BLACK, 1500, "5+3", ""))
    page.locator("[data-word=new]").click()  # what was chosen last is remembered
    page.get_by_role("switch", name="Full strength").check()
    page.get_by_role("radio", name="Other", exact=True).check()
    page.get_by_role("textbox", name="Time control").fill("forty")
    button(page, "Begin")
    expect(page.get_by_role("alert")).to_contain_text("'forty' is not a time control")
    page.get_by_role("textbox", name="Time control").fill("40/90, 30+30")
    button(page, "Begin")
    begun(stage, "new black full clock 40/90,30+30 fen start", NewGame(chess.BLACK, 0, "40/90,30+30", ""))
    page.locator("[data-word=new]").click()
    page.get_by_role("radio", name="No clock").check()
    page.get_by_role("radio", name="White").check()
    page.get_by_role("radio", name="Another").check()
    page.get_by_role("textbox", name="Position as FEN").fill(PROMOTING)
    button(page, "Begin")
    begun(stage, f"new white full clock none fen {PROMOTING}", NewGame(chess.WHITE, 0, "", PROMOTING))


def test_a_position_is_set_up_by_pointer_and_keyboard(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    page, keyboard = visitor.page, visitor.page.keyboard
    page.locator(".more summary").click()
    page.locator("[data-word=setup]").click()
    fen = page.get_by_role("textbox", name="Position as FEN")
    expect(fen).to_have_value(f"{chess.STARTING_BOARD_FEN} w KQkq - 0 1")
    button(page, "Clear")
    expect(page.get_by_role("button", name="Play from here")).to_be_disabled()
    expect(page.locator(".problem")).to_have_text("White needs one king, and has 0")

    def cell(square: str) -> tuple[float, float]:
        box = page.locator(f".editor .grid [data-square={square}]").bounding_box()
        assert box is not None
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    king = page.get_by_role("button", name="white king").bounding_box()  # dragged from the palette
    assert king is not None
    page.mouse.move(king["x"] + king["width"] / 2, king["y"] + king["height"] / 2)
    page.mouse.down()
    page.mouse.move(*cell("d4"), steps=4)
    page.mouse.up()
    expect(fen).to_have_value("8/8/8/8/3K4/8/8/8 w - - 0 1")
    page.mouse.move(*cell("d4"))  # and on to where a right to castle comes with it
    page.mouse.down()
    page.mouse.move(*cell("e1"), steps=4)
    page.mouse.up()
    page.get_by_role("button", name="white rook").click()  # chosen, and put down by clicks
    page.mouse.click(*cell("h1"))
    page.mouse.click(*cell("c3"))
    page.mouse.click(*cell("c3"))
    page.get_by_role("switch", name="White, king side").check()
    page.get_by_role("radio", name="Black").check()
    page.locator(".editor .grid [data-square=e2]").focus()
    for key in ("k", "ArrowUp", "k", "ArrowDown", "Delete"):
        keyboard.press(key)
    expect(fen).to_have_value("8/8/8/8/8/4k3/8/4K2R b K - 0 1")
    fen.fill("8/8/8/8/8/4k3/8/4K2R b K")
    fen.press("Tab")
    button(page, "Play from here")
    expect(page.get_by_role("textbox", name="Position as FEN")).to_have_value("8/8/8/8/8/4k3/8/4K2R b K - 0 1")
    button(page, "Begin")
    until(lambda: len(stage.game.lines) == 1)
    assert stage.game.lines[0].endswith(" fen 8/8/8/8/8/4k3/8/4K2R b K - 0 1")


def test_what_a_fen_says_beside_the_pieces_is_kept_unless_they_are_changed(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    page = visitor.page
    page.locator(".more summary").click()
    page.locator("[data-word=setup]").click()
    fen = page.get_by_role("textbox", name="Position as FEN")
    en_passant = "rnbqkbnr/ppp1p1pp/8/3pPp2/8/8/PPPP1PPP/RNBQKBNR"
    fen.fill(f"{en_passant}  w  KQkq f6 0 3")
    fen.press("Tab")
    expect(fen).to_have_value(f"{en_passant} w KQkq f6 0 3")
    page.get_by_role("switch", name="Black, king side").uncheck()
    expect(fen).to_have_value(f"{en_passant} w KQq - 0 1")
    page.get_by_role("switch", name="Black, king side").check()
    button(page, "Play from here")
    expect(page.get_by_role("textbox", name="Position as FEN")).to_have_value(f"{en_passant} w KQkq f6 0 3")


# ---------------------------------------------------------------------------------------------------- several visitors


def test_the_controls_go_from_one_to_the_other(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    one, two = visit(stage), visit(stage, "phone")
    asked_to_move(stage, one)
    expect(two.page.locator("#open-controls")).to_have_attribute("data-role", "watcher")
    expect(two.page.locator("#open-controls")).to_contain_text("2")
    expect(two.page.locator("#line")).to_be_disabled()
    two.click("e2", "e4")
    two.page.locator("#open-controls").click()
    button(two.page, "Ask for the controls")
    button(one.page, "Keep")
    expect(two.page.get_by_role("button", name="Ask for the controls")).to_be_visible()
    button(two.page, "Ask for the controls")
    button(one.page, "Hand over")
    expect(two.page.locator("#open-controls")).to_have_attribute("data-role", "holder")
    two.page.keyboard.press("Escape")
    one.click("d2", "d4")
    two.click("e2", "e4")
    said(stage, "e2e4")
    two.page.locator("#open-controls").click()
    button(two.page, "Release the controls")
    one.page.locator("[data-banner=free]").get_by_role("button").click()
    expect(one.page.locator("#open-controls")).to_have_attribute("data-role", "holder")


def test_who_loads_the_page_anew_keeps_the_controls(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    one, two = visit(stage), visit(stage)
    asked_to_move(stage, one)
    one.page.reload()
    asked_to_move(stage, one)
    expect(one.page.locator("#open-controls")).to_have_attribute("data-role", "holder")
    expect(two.page.locator("#open-controls")).to_have_attribute("data-role", "watcher")
    one.click("e2", "e4")
    said(stage, "e2e4")


def test_anybody_stops_the_arm_by_button_key_and_from_a_dialog(set_stage: SetStage, visit: Visit) -> None:
    at_once = "performance.now = () => 1000.0;"  # the two Escapes come as one, however busy the machine is
    stage = set_stage()
    one, two = visit(stage, scripts=(at_once,)), visit(stage, "phone")
    two.page.locator("#stop").click()
    until(lambda: stage.stops == 1)
    expect(two.page.locator("[data-banner=stop]")).to_contain_text("Stopped: the arm holds still.")
    expect(two.page.get_by_role("button", name="Continue")).to_have_count(0)
    one.page.keyboard.press("Escape")
    one.page.keyboard.press("Escape")
    until(lambda: stage.stops == 2)
    one.page.locator("[data-banner=stop]").get_by_role("button", name="Continue").click()
    said(stage, "go")
    stage.stopped = False
    expect(two.page.locator("[data-banner=stop]")).to_have_count(0)
    one.page.locator("#open-settings").click()
    one.page.locator("dialog").get_by_role("button", name="STOP").click()
    until(lambda: stage.stops == 3)


def show_record(visitor: Visitor) -> None:
    """One that the server is still making: what is shown of it does not matter."""
    visitor.page.route("**/games/*/record.json", lambda _: None)
    visitor.page.locator("#open-games").click()
    visitor.page.locator("dialog .game-links").get_by_role("button").click()
    expect(visitor.page.locator("[data-banner=record]")).to_be_visible()


def test_stop_is_said_as_it_is_also_while_a_record_is_shown(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    banner = visitor.page.locator("[data-banner=stop]")
    show_record(visitor)
    visitor.page.locator("#stop").click()
    expect(banner).to_contain_text("Stopped: the arm holds still.")
    visitor.page.locator("[data-banner=record]").get_by_role("button").click()
    expect(visitor.page.locator("[data-banner=record]")).to_have_count(0)
    show_record(visitor)
    banner.get_by_role("button", name="Continue").click()
    said(stage, "go")
    stage.stopped = False
    expect(banner).to_have_count(0)


def test_while_a_record_is_shown_nothing_is_said_of_it_as_of_the_game(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    show_record(visitor)
    expect(visitor.page.locator("#ask .ask-title")).to_have_text("A recorded game")
    expect(visitor.page.locator("#line")).to_have_attribute("placeholder", "A recorded game is shown")
    visitor.page.locator("[data-banner=record]").get_by_role("button").click()
    expect(visitor.page.locator("#ask .ask-title")).to_have_text("Your move")


def test_a_page_of_records_that_reconnects_stays_at_the_record_that_was_chosen(
    set_stage: SetStage, visit: Visit
) -> None:
    stage = set_stage()
    RecordedGame(stage.game.folder.parent / "other").record.close()
    visitor = visit(stage)
    visitor.page.route("**/games/*/record.json", lambda _: None)

    def reads() -> list[str]:
        return [urlsplit(one).path.split("/")[2] for one in visitor.requests if one.endswith("record.json")]

    records = {"live": False, "ended": None, "shows": "game"}
    stage.put(session=records)
    until(lambda: visitor.page.evaluate("1") and reads() == ["game"])
    visitor.page.locator("#open-games").click()
    visitor.page.locator("dialog").get_by_role("button", name="Show a").click()
    until(lambda: visitor.page.evaluate("1") and reads() == ["game", "other"])
    stage.put(session=records, devices=[{"name": "told", "ok": True, "text": "again"}])
    expect(visitor.page.locator(".device-name")).to_contain_text(["Told"])  # a list: others are there until it comes
    assert reads() == ["game", "other"]


def test_a_record_that_could_not_be_shown_can_be_chosen_again(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    page, answers = visitor.page, ["{", "{"]
    page.route("**/games/*/record.json", lambda route: route.fulfill(body=answers.pop()))
    for left in (1, 0):
        page.locator("#open-games").click()
        page.locator("dialog .game-links").get_by_role("button").click()
        until(lambda left=left: page.evaluate("1") and len(answers) == left)
        expect(page.locator("#record .tm-sentence").first).to_contain_text("This game cannot be shown")
        page.locator("#tab-camera").click()
    expect(page.locator("#record")).to_be_hidden()


def test_without_an_arm_nothing_is_left_of_a_record_that_is_closed(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    panels = visitor.page.locator("#panels")
    stage.put(session={"rig": "board", "person": "white", "hands": False, "sees": False, "live": True})
    expect(panels).to_be_hidden()
    show_record(visitor)
    expect(panels).to_be_visible()
    visitor.page.locator("[data-banner=record]").get_by_role("button").click()
    expect(panels).to_be_hidden()


def test_stop_in_a_dialog_is_what_stop_is_now(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    watches = {"you": 2, "holder": 1, "watchers": 2, "asking": None}
    stage.put(controls={**watches, "stoppable": False})
    expect(visitor.page.locator("#stop")).to_be_disabled()
    visitor.page.locator("#open-settings").click()
    here = visitor.page.locator("dialog .stop-here")
    expect(here).to_be_disabled()
    stage.put(controls={**watches, "stoppable": True})
    expect(here).to_have_text("STOP")
    here.click()
    until(lambda: stage.stops == 1)


def test_without_a_controller_stop_is_a_pause(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage(stoppable=False)
    one, two = visit(stage), visit(stage)
    asked_to_move(stage, one)
    expect(two.page.locator("#stop")).to_be_disabled()
    one.page.locator("#stop").click()
    said(stage, "pause")


def test_a_lost_connection_is_said_and_had_again(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    visitor.cut()
    expect(visitor.page.locator("[data-banner=connection]")).to_contain_text("The connection to the game is lost.")
    visitor.click("e2", "e4")
    visitor.page.locator("#stop").click()
    expect(visitor.page.locator("[data-banner=stop]")).to_contain_text("STOP could not be sent")
    assert stage.stops == 0
    visitor.page.locator("#open-controls").click()
    button(visitor.page, "Release the controls")
    expect(visitor.page.locator("[data-banner=refused]")).to_contain_text("There is no connection to the game")
    visitor.page.keyboard.press("Escape")
    visitor.mend()
    expect(visitor.page.locator("[data-banner=connection]")).to_have_count(0)
    expect(visitor.page.locator("[data-banner=stop]")).to_have_count(0)
    expect(visitor.page.locator("#ask")).to_have_attribute("data-mood", "turn")
    visitor.click("e2", "e4")
    said(stage, "e2e4")


# -------------------------------------------------------------------------------------------------- sound, and the rest


def test_the_voice_says_moves_and_questions_once_it_is_wanted(set_stage: SetStage, visit: Visit) -> None:
    listen = "window.spoken = []; speechSynthesis.speak = (words) => spoken.push(words.text);"
    stage = set_stage()
    visitor = visit(stage, scripts=(listen,))
    played(stage, "e2e4")
    expect(visitor.page.locator("#moves button.move")).to_have_count(1)
    visitor.page.locator("#open-settings").click()
    visitor.page.get_by_role("switch", name=re.compile("^Voice")).check()
    played(stage, "g8f6")
    expect(visitor.page.locator("#moves button.move")).to_have_count(2)
    stage.game.publisher.prompt("was that it? (yes or no)", ("yes", "no"))
    visitor.until("spoken.length >= 3")
    assert visitor.page.evaluate("spoken") == ["Voice on", "Black: knight f6", "was that it? (yes or no)"]
    visitor.page.reload()
    expect(visitor.page.locator("#moves button.move")).to_have_count(2)
    played(stage, "d2d4")
    visitor.until("spoken.length >= 1")
    assert visitor.page.evaluate("spoken") == ["White: d4"]


def test_sounds_are_made_until_they_are_muted(set_stage: SetStage, visit: Visit) -> None:
    count = "window.knocks = 0; const start = AudioBufferSourceNode.prototype.start; "
    count += "AudioBufferSourceNode.prototype.start = function (...when) { knocks += 1; start.apply(this, when); };"
    count += "AudioContext = class extends AudioContext { constructor() { super(); window.audio = this; } };"
    stage = set_stage()
    visitor = visit(stage, scripts=(count,))
    visitor.page.locator("h1").click()  # only then a browser admits sound
    visitor.until("window.audio?.state === 'running'")
    played(stage, "e2e4")
    visitor.until("knocks === 1")
    played(stage, "d7d5")
    visitor.until("knocks === 2")
    played(stage, "e4d5")
    visitor.until("knocks === 4")  # a capture is two
    visitor.page.locator("#open-settings").click()
    visitor.page.get_by_role("switch", name="Sounds").uncheck()
    played(stage, "d8d5")
    expect(visitor.page.locator("#moves button.move")).to_have_count(4)
    assert visitor.page.evaluate("knocks") == 4
    assert visitor.page.evaluate("localStorage.getItem('touchmove.sound')") == "false"


def test_colours_follow_the_system_unless_they_are_chosen(set_stage: SetStage, visit: Visit) -> None:
    visitor = visit(set_stage())
    paper = "getComputedStyle(document.body).backgroundColor"
    light = visitor.page.evaluate(paper)
    visitor.page.emulate_media(color_scheme="dark")
    dark = visitor.page.evaluate(paper)
    assert light != dark
    visitor.page.locator("#open-settings").click()
    visitor.page.get_by_role("radio", name="Light").check()
    assert visitor.page.evaluate(paper) == light
    visitor.page.reload()
    assert visitor.page.evaluate(paper) == light


@pytest.mark.parametrize("size", ["phone", "flat", "tablet", "desk", "tv"])
def test_everything_fits_the_screen(set_stage: SetStage, visit: Visit, size: str) -> None:
    stage = set_stage()
    visitor = visit(stage, size)
    asked_to_move(stage, visitor)
    page = visitor.page
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    board, stop = page.locator("#board").bounding_box(), page.locator("#stop").bounding_box()
    assert board is not None
    assert stop is not None
    width, height = page.evaluate("[innerWidth, innerHeight]")
    for box in (board, stop):
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= width
        assert box["y"] + box["height"] <= height
    assert board["width"] >= 0.42 * min(width, height)
    assert abs(board["width"] - board["height"]) < 1.0
    assert min(stop["width"], stop["height"]) >= 44.0


def test_nothing_comes_from_another_host(set_stage: SetStage, visit: Visit) -> None:
    stage = set_stage()
    visitor = visit(stage)
    asked_to_move(stage, visitor)
    for dialog in ("#open-settings", "#open-games", "[data-word=new]"):
        visitor.page.locator(dialog).click()
        visitor.page.keyboard.press("Escape")
        visitor.page.wait_for_timeout(800)  # two Escapes within less would be STOP
    here = urlsplit(stage.address).netloc
    assert len(visitor.requests) > 20
    modules = {urlsplit(url).path.removeprefix("/static/") for url in visitor.requests if url.endswith(".js")}
    assert modules == {*StaticFiles().modules(), "theme.js"}, "the page links to what it loads, and to nothing else"
    assert {urlsplit(url).netloc for url in visitor.requests if not url.startswith("data:")} == {here}
    assert stage.stops == 0
