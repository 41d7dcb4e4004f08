"""Laws of the record that two robots keep, under cuts, kills, and whatever players do meanwhile."""

from __future__ import annotations

import random
from pathlib import Path

import chess
import pytest

from app.linked.errors import LinkBroken, LinkError, LinkRefused
from app.linked.log import LOG_FILE, LinkedLog
from app.linked.messages import EntriesMessage, MoveEntry, StandingMessage, SyncMessage, TakeBackEntry
from app.linked.opponent import new_game
from app.players.remote import GameOver, Offer, OfferAnswered, Offered, TakenBack
from app.settings.defaults import LinkRole
from tests.app.linked.pair import GUEST, HOST, Clockwork, Robot, Wire, pair


def line(robot: Robot) -> list[str]:
    return [move.uci() for move in robot.table.move_stack]


def agree(host: Robot, guest: Robot) -> None:
    """Both tables show the game that both have recorded."""
    assert host.log.digests == guest.log.digests
    assert host.table.fen() == guest.table.fen() == host.log.state.board.fen()
    assert line(host) == line(guest)


def play_on(robots: tuple[Robot, Robot], draw: random.Random) -> None:
    """Whoever is to move moves, if their table knows."""
    for robot in robots:
        robot.heed()
        state = robot.log.state
        if state.begin is None or state.over or robot.over is not None or not robot.stood:
            continue
        if state.writer is robot.role and state.board.fen() == robot.table.fen():
            robot.move(draw.choice(sorted(robot.table.legal_moves, key=chess.Move.uci)))


def mishap(wire: Wire, robots: tuple[Robot, Robot], draw: random.Random) -> None:
    robot = draw.choice(robots)
    match draw.choice(("cut", "connect", "kill", "draw", "back", "decline")):
        case "cut":
            wire.cut()
        case "connect" if not wire.up:
            wire.connect()
        case "kill":
            wire.cut()
            robot.kill(table=draw.choice((0, 1, 2)))
        case "draw":
            robot.opponent.offer(Offer.DRAW)
        case "back":
            robot.opponent.offer(Offer.TAKE_BACK)
        case "decline":
            robot.opponent.decline(draw.choice((Offer.DRAW, Offer.TAKE_BACK)))
        case _:
            pass


@pytest.mark.parametrize("seed", range(12))
def test_whatever_is_cut_or_killed_both_have_the_same_game(tmp_path: Path, seed: int) -> None:
    draw = random.Random(seed)
    host, guest, wire = pair(tmp_path, plies=60)
    robots = host, guest
    for _ in range(600):
        what = draw.random()
        if what < 0.55:
            wire.deliver(draw.choice((HOST, GUEST)))
        elif what < 0.75:
            draw.choice(robots).heed()
        elif what < 0.95:
            play_on(robots, draw)
        else:
            mishap(wire, robots, draw)
    if wire.up:
        wire.cut()
    wire.connect()
    wire.settle()
    agree(host, guest)
    if host.over is not None or guest.over is not None:
        assert host.over == guest.over
    assert host.peer.have == len(host.log) == guest.peer.have


def test_a_game_to_mate_ends_alike_once_both_have_the_last_move(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    for mover, move in zip((host, guest, host, guest), ("f2f3", "e7e5", "g2g4", "d8h4"), strict=True):
        if move == "d8h4":
            wire.cut()
        mover.move(move)
        if wire.up:
            wire.settle()
    guest.heed()
    assert guest.over is None, "the other robot does not know of the mate yet"
    wire.connect()
    wire.settle()
    agree(host, guest)
    assert host.over == guest.over
    assert host.over is not None
    assert (host.over.end.result, host.over.end.reason) == ("0-1", "checkmate")


def test_a_table_that_lags_behind_the_record_is_told_what_it_lacks_its_own_moves_too(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    for mover, move in zip((host, guest, host), ("e2e4", "e7e5", "g1f3"), strict=True):
        mover.move(move)
        wire.settle()
    wire.cut()
    host.kill(table=2)
    host.heed()
    assert line(host) == ["e2e4", "e7e5", "g1f3"], "without the other robot: the record here holds it"
    wire.connect()
    wire.settle()
    agree(host, guest)


def test_a_robot_that_has_lost_its_record_gets_it_from_the_other(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    for mover, move in zip((host, guest, host), ("e2e4", "e7e5", "g1f3"), strict=True):
        mover.move(move)
        wire.settle()
    wire.cut()
    (guest.folder / LOG_FILE).unlink()
    guest.kill(table=3)
    wire.connect()
    wire.settle()
    agree(host, guest)


def test_another_game_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    host, guest, _ = pair(tmp_path)
    before = host.log.digests[:]
    other = new_game(chess.STARTING_FEN, chess960=False, host_is_white=True, clock=None, plies=300)
    for length in (0, 1):
        with pytest.raises(LinkRefused, match=r"^the other robot plays another game than this one: name the folder"):
            host.peer.received(SyncMessage(name="x", length=length, head="0" * 64))
    with pytest.raises(LinkRefused, match="another game"):
        guest.peer.received(EntriesMessage(at=0, entries=(other,), head="0" * 64))
    assert host.log.digests == guest.log.digests == before


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        (MoveEntry(ply=1, uci="e7e5"), "cannot be ply 2"),
        (MoveEntry(ply=0, uci="e2e5"), "cannot be ply 1"),
        (MoveEntry(ply=0, uci="e2e4"), "has moved for this side"),
        (TakeBackEntry(plies=0), "cannot be taken back"),
        (new_game("8/8/8/8/8/8/8/8 w - - 0 1", chess960=False, host_is_white=True, clock=None, plies=9), "under way"),
    ],
)
def test_what_the_other_robot_may_not_write_is_refused(tmp_path: Path, entry: MoveEntry, why: str) -> None:
    host, _, _ = pair(tmp_path)
    with pytest.raises(LinkBroken, match=why):
        host.peer.received(EntriesMessage(at=1, entries=(entry,), head=_after(host, entry)))
    assert len(host.log) == 1
    assert host.opponent.next(0.0) is None


def _after(robot: Robot, entry: MoveEntry) -> str:
    from app.linked.log import digest_after

    return digest_after(robot.log.digests[-1], entry)


def test_tables_that_differ_stop_both_robots(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    guest.peer.say(StandingMessage(length=1, fen="8/8/8/8/8/8/8/8 w - - 0 1"))
    wire.settle()
    assert host.over is not None
    assert not host.over.end.complete
    assert host.over.end.reason.startswith("on the other table stands 8/8/8/8/8/8/8/8 w - - 0 1, but the game has rnbq")
    guest.opponent.stands(chess.Board("8/8/8/8/8/8/8/8 w - - 0 1"))
    guest.heed()
    assert guest.over is not None
    assert guest.over.end.reason.startswith("on the table here stands 8/8")


def test_a_record_that_contradicts_itself_is_refused(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.move("e2e4")
    wire.settle()
    host.log.__exit__()
    path = host.folder / LOG_FILE
    path.write_text(path.read_text().replace("e2e4", "e2e5"))
    with pytest.raises(LinkError, match=r"^line 2 of .*link.jsonl does not belong to this game: nothing can go on"):
        LinkedLog(host.folder, go_on=True)
    assert line(guest) == ["e2e4"]


# ---------------------------------------------------------------------------------------------------------- agreements


def test_a_draw_is_agreed_on_whoever_is_to_move(tmp_path: Path) -> None:
    for accepts_first in (True, False):
        host, guest, wire = pair(tmp_path / str(accepts_first)) if _made(tmp_path / str(accepts_first)) else (None,) * 3
        assert host is not None
        assert guest is not None
        assert wire is not None
        asker, asked = (guest, host) if accepts_first else (host, guest)
        asker.opponent.offer(Offer.DRAW)
        wire.settle()
        assert Offered(Offer.DRAW) in asked.events
        asked.opponent.offer(Offer.DRAW)
        wire.settle()
        agree(host, guest)
        assert host.over == guest.over
        assert host.over is not None
        assert (host.over.end.result, host.over.end.reason) == ("1/2-1/2", "draw by agreement")


def _made(folder: Path) -> bool:
    folder.mkdir()
    return True


def test_an_answer_that_a_cut_has_swallowed_is_said_again(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.opponent.offer(Offer.DRAW)
    wire.settle()
    guest.opponent.offer(Offer.DRAW)
    wire.cut()
    assert host.over is None
    wire.connect()
    wire.settle()
    assert host.over == guest.over
    assert host.over is not None


def test_a_declined_offer_is_answered_and_an_overtaken_one_lapses(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.move("e2e4", offers_draw=True)
    wire.settle()
    assert Offered(Offer.DRAW) in guest.events
    guest.opponent.decline(Offer.DRAW)
    wire.settle()
    assert OfferAnswered(Offer.DRAW, accepted=False) in host.events
    guest.move("e7e5")
    guest.opponent.offer(Offer.TAKE_BACK)
    wire.settle()
    assert Offered(Offer.TAKE_BACK, 1) in host.events
    host.move("g1f3")  # instead of an answer
    wire.settle()
    host.opponent.offer(Offer.TAKE_BACK)  # now it is a proposal of its own
    wire.settle()
    guest.opponent.offer(Offer.TAKE_BACK)
    wire.settle()
    assert host.events[-1] == guest.events[-1] == TakenBack(2)
    agree(host, guest)
    assert line(host) == ["e2e4", "e7e5"]


@pytest.mark.parametrize("role", list(LinkRole))
def test_who_resigns_loses_also_while_the_link_is_cut(tmp_path: Path, role: LinkRole) -> None:
    host, guest, wire = pair(tmp_path)
    wire.cut()
    (host if role is HOST else guest).opponent.resign()
    wire.settle()
    assert (host.over is None) is (role is GUEST), "who is to move writes it down at once, who is not has to be heard"
    wire.connect()
    wire.settle()
    assert host.over == guest.over
    assert host.over is not None
    assert host.over.end.result == ("0-1" if role is HOST else "1-0")


def test_a_resignation_and_a_move_that_cross_leave_one_game(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.move("e2e4")
    wire.settle()
    host.opponent.resign()  # while Black, who does not know, moves
    guest.move("e7e5")
    wire.settle()
    agree(host, guest)
    assert host.over == guest.over
    assert isinstance(host.over, GameOver)
    assert (host.over.end.result, line(host)) == ("0-1", ["e2e4", "e7e5"])


def test_a_game_is_aborted_only_before_both_have_moved(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.move("e2e4")
    guest.opponent.stands(guest.table)
    wire.settle()
    guest.move("e7e5")
    wire.settle()
    host.opponent.abort()
    wire.settle()
    assert host.said() == ["both sides have moved, so the game cannot be aborted: resign or offer a draw"]
    assert host.over is None


def test_an_abort_that_comes_too_late_is_over_and_who_asked_is_told(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.move("e2e4")
    wire.settle()
    host.opponent.abort()  # while Black, who does not know, moves
    guest.move("e7e5")
    wire.settle()
    assert host.said() == ["your 'abort' came too late: both sides have moved by now; resign or offer a draw"]
    assert guest.said() == []
    for proposes, agrees in ((host, guest), (guest, host)):
        proposes.opponent.offer(Offer.TAKE_BACK)
        wire.settle()
        agrees.opponent.offer(Offer.TAKE_BACK)
        wire.settle()
    agree(host, guest)
    assert (line(host), host.over, guest.over) == ([], None, None)
    guest.opponent.abort()  # now it is in time
    wire.settle()
    assert host.over == guest.over
    assert isinstance(host.over, GameOver)
    assert host.over.end.reason == "aborted"


@pytest.mark.parametrize("told", [False, True])
def test_an_abort_that_a_cut_held_up_comes_too_late_all_the_same(tmp_path: Path, told: bool) -> None:
    host, guest, wire = pair(tmp_path)
    host.move("e2e4")
    wire.settle()
    if not told:
        wire.cut()
    host.opponent.abort()
    if told:
        wire.deliver(GUEST)  # its loop has not looked yet
        wire.cut()
    guest.opponent.play(1, chess.Move.from_uci("e7e5"))
    wire.connect()
    wire.settle()
    assert (host.peer.request, guest.peer.asked, host.over, guest.over) == (None, None, None, None)
    assert [said for said in host.said() if "too late" in said] == host.said()[-1:]


def test_threefold_repetition_is_claimed_by_who_is_to_move(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    for ply in range(8):
        mover = host if ply % 2 == 0 else guest
        mover.move(("g1f3", "g8f6", "f3g1", "f6g8")[ply % 4])
        wire.settle()
    host.opponent.offer(Offer.DRAW)
    wire.settle()
    assert host.over == guest.over
    assert host.over is not None
    assert (host.over.end.result, host.over.end.reason) == ("1/2-1/2", "threefold repetition")


def test_a_rematch_changes_the_colours(tmp_path: Path) -> None:
    host, guest, wire = pair(tmp_path)
    host.opponent.resign()
    wire.settle()
    assert host.over is not None
    guest.over = host.over = None
    guest.opponent.offer(Offer.REMATCH)
    wire.settle()
    host.opponent.offer(Offer.REMATCH)
    wire.settle()
    for robot in (host, guest):
        assert OfferAnswered(Offer.REMATCH, accepted=True) in robot.events
        robot.table.reset()
        robot.stood = False
    wire.settle()
    assert (host.opponent.colour, guest.opponent.colour) == (chess.WHITE, chess.BLACK)
    guest.move("d2d4")
    wire.settle()
    agree(host, guest)


# --------------------------------------------------------------------------------------------------------------- clocks


def test_time_runs_where_the_position_stands_and_not_while_a_board_is_put_right_or_the_link_is_cut(
    tmp_path: Path,
) -> None:
    now = Clockwork()
    host, guest, wire = pair(tmp_path, clock="1+2", now=now)

    def left() -> tuple[float, float]:
        clocks = [robot.opponent.clock() for robot in (host, guest)]
        assert clocks[0] is not None
        assert clocks[1] is not None
        assert (clocks[0].white_left, clocks[0].black_left) == (clocks[1].white_left, clocks[1].black_left)
        return clocks[0].white_left, clocks[0].black_left

    now.time += 10.0
    assert left() == (50.0, 60.0)
    guest.opponent.mending(True)
    wire.settle()
    now.time += 10.0
    assert left() == (50.0, 60.0)
    guest.opponent.mending(False)
    wire.settle()
    wire.cut()
    now.time += 10.0
    assert left() == (50.0, 60.0)
    wire.connect()
    wire.settle()
    now.time += 5.0
    assert left() == (45.0, 60.0)
    host.move("e2e4")
    now.time += 3.0
    wire.settle()  # Black's table shows the move only now
    assert left() == (47.0, 60.0)
    now.time += 61.0
    wire.settle()
    assert host.over == guest.over
    assert host.over is not None
    assert (host.over.end.result, host.over.end.reason) == ("1-0", "Black's time has run out")
    assert any("puts its board right: both clocks stand" in sentence for sentence in host.said())
