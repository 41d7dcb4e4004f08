"""Row of bench ``vision``: how soon a person's move is known after the hand has left the board.

A person plays both sides of a random game in a world of its own: hand, the guard's watch and the observer in the loop.
When the last part of the hand has left board and trays, seen from above, and when the board alone, is the referee's
word: over a tray it may still put down what it has taken, so it has not gone. The move is known when the
frame that shows it settled was delivered, in plant time, and looked at, in time of the processor, which stands for
plant time on a real robot.
"""

from __future__ import annotations

import random
import time
from contextlib import closing
from typing import Final

import chess

from app import UserError
from app.guard.hand_guard import HandGuard
from app.measure.bench.report import Progress, Row, Tally, row
from app.measure.bench.vision.games import BoardReader
from app.measure.bench.vision.hand_scene import Follower, HandScene, hand_scene, until
from app.pieces.manipulation import transfers
from app.play.hand_moves import hand_transfers
from hardware.interfaces import DepthFrame, Frame, HardwareError
from hardware.piece_set import Colour
from hardware.sim.clients.hand import SimHand
from hardware.sim.hand.actions import HandSettings, Withdraw
from vision.hands.hand_and_motion import Seen, Watch
from vision.reading.observer import Observation
from vision.reading.outcome import ReadingOutcome

SEED: Final = 31
MOVES: Final = {True: 1, False: 40}
"""By ``quick``."""
A_WORLD: Final = 8  # so many moves are made in one world
KNOWN: Final = "hand gone to move known"  # from leaving board and trays …
OFF_BOARD: Final = "hand off the board to move known"  # … and from leaving the board, perhaps for a tray [s]
KNOWN_LIMIT: Final = 0.6  # from the hand's leaving the board until the move is known [s]
LOOKS: Final = 5  # so many settled frames are looked at before the move counts as not read


def turn_rows(quick: bool, progress: Progress) -> dict[str, Row]:
    """Measure; errors as of ``app.measure.bench.vision.hands.hand_rows``."""
    moves, figures, rng = MOVES[quick], Tally(list), random.Random(SEED)
    try:
        for first in range(0, moves, A_WORLD):
            person = HandSettings(side=rng.choice(list(Colour)), speed=rng.uniform(0.5, 1.0))
            with hand_scene(SEED + first, person) as scene:
                _play(scene, min(A_WORLD, moves - first), rng, figures, progress)
    except HardwareError as error:
        raise UserError(str(error)) from error
    rows = {"move wrong": row(figures["move wrong"], "1", 0.0, "max"), "move asked": row(figures["move asked"], "1")}
    if figures[KNOWN]:
        rows |= {KNOWN: row(figures[KNOWN], "s", KNOWN_LIMIT, "max"), OFF_BOARD: row(figures[OFF_BOARD], "s")}
    return rows


def _play(scene: HandScene, moves: int, rng: random.Random, figures: Tally, progress: Progress) -> None:
    """A game by hand. The camera watches from before the hand withdraws: pictures take most of the bench's time."""
    board, inventory, watch, delivered = chess.Board(), scene.inventory, Watch(), dict[float, float]()
    half = scene.table.half_play

    def note_delivery(frame: Frame | DepthFrame, _seen: Seen) -> None:
        delivered[frame.stamp] = scene.history.newest  # plant time stands meanwhile, so it is the time of delivery

    with closing(SimHand(scene.run_dir)) as hand:
        with scene.colour_guard(watch) as guard:
            reader = BoardReader(guard.settled()[0], board, scene.table)
        for _ in range(moves):
            # a promotion is asked for where it is not seen; here it is about time
            move = rng.choice([move for move in board.legal_moves if not move.promotion])
            ply = transfers(board, move, inventory)
            hand.do(*hand_transfers(ply.transfers, scene.table))
            watch.pause()
            delivered.clear()
            guard = scene.colour_guard(watch, note_delivery)
            with guard, closing(Follower(scene)) as follower:
                hand.perform(Withdraw())
                look, known = _known_at(guard, reader, delivered, move, figures)
                if known is not None:
                    gone = until(lambda: follower.crossings(half)[-1:], "a hand that leaves the table")[0]
                    off_board = until(lambda: follower.crossings()[-1:], "a hand that leaves the board")[0]
                    figures[KNOWN].append(known - gone)
                    figures[OFF_BOARD].append(known - off_board)
                hand.wait()
            board.push(move)
            inventory = inventory.after(ply)
            reader.observer.confirm(look, board)
            last = f"known after {figures[KNOWN][-1]:.3f} s, " if figures[KNOWN] else "not read"
            last += f"{figures[OFF_BOARD][-1]:.3f} s after the hand was off the board" if figures[KNOWN] else ""
            progress(f"{len(figures['move wrong'])} moves by hand, {ply.san}: {last}")


def _known_at(
    guard: HandGuard, reader: BoardReader, delivered: dict[float, float], move: chess.Move, figures: Tally
) -> tuple[Observation, float | None]:
    """Look until a move is read, and when that was [s]; ``delivered``: when frames came, by their stamps."""
    after, known = None, None
    for _ in range(LOOKS):
        frame, _ = guard.settled(after)
        after = frame.stamp
        since = time.thread_time()
        look, decision = reader.read(frame)
        spent = time.thread_time() - since
        if decision.verdict is ReadingOutcome.MOVE:
            known = delivered[frame.stamp] + spent
            break
    figures["move asked"].append(float(known is None))
    figures["move wrong"].append(float(known is not None and decision.moves != (move,)))
    return look, known
