"""The hand of a world in a process of its own: asked over the socket, seen by nobody but the referee."""

from __future__ import annotations

import json
import math
import os
import select
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from hardware.interfaces import Command, DriveStatus, HandRefused, HardwareError
from hardware.parameters import load_parameters
from hardware.piece_set import Colour, Kind
from hardware.sim.clients import wire
from hardware.sim.clients.bus import SimServoBus
from hardware.sim.clients.hand import SimHand
from hardware.sim.clients.referee import SimReferee
from hardware.sim.hand.actions import Hover, Move, Take, Withdraw
from hardware.sim.plant.snapshot import STATE_FILE
from hardware.sim.process.settings import END_FILE, FILE_NAME, WorldSettings
from hardware.table import PieceSpec, Place, TableSettings
from tests.hardware.sim.process.test_world import LONG, world_command
from tests.waiting import PATIENCE, until

TABLE = TableSettings()
SPECS = tuple(
    PieceSpec(name, kind, colour, Place.parse(place))
    for name, kind, colour, place in (
        ("king", Kind.KING, Colour.WHITE, "e1"), ("pawn", Kind.PAWN, Colour.WHITE, "e2"),
        ("rook", Kind.ROOK, Colour.BLACK, "h8"), ("knight", Kind.KNIGHT, Colour.WHITE, "b1"),
    )
)  # fmt: skip
TICK = load_parameters().drive.tick
BRAKED = Command((0.0, 0.0, 0.0), 0.0, brake=True, enable=False, busy=False)


def xy(place: str) -> tuple[float, float]:
    return TABLE.xy(Place.parse(place))


class WorldProcess:
    """A world as the app starts it."""

    def __init__(self, run_dir: Path, **changes: object) -> None:
        x, y, z = TABLE.base_from_board(np.array([0.0, -0.075, 0.145])).tolist()
        usual: dict[str, object] = {
            "pieces": SPECS, "home": (x, y, z), "pace": "fast", "cameras": False, "seed": 3, "first_controller": LONG,
            "linger": LONG, "hand": {"side": "white"},
        }  # fmt: skip
        settings = WorldSettings.model_validate({**usual, **changes})
        (run_dir / FILE_NAME).write_text(settings.model_dump_json(), encoding="utf-8")
        self.run_dir = run_dir
        with (run_dir / "world.log").open("wb") as log:
            self.process = subprocess.Popen(
                world_command(run_dir),
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=dict(os.environ),
            )  # fmt: skip

    def terminate(self) -> dict[str, object]:
        """End it in good order; what it left."""
        self.process.terminate()
        assert self.process.wait(PATIENCE) == 0
        return dict(json.loads((self.run_dir / END_FILE).read_text(encoding="utf-8")))

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[WorldProcess]:
    """A world for all whose hand withdraws in the end, each with a piece of its own if it needs one."""
    process = WorldProcess(tmp_path_factory.mktemp("world"))
    yield process
    process.kill()


def test_a_move_is_made_while_nobody_holds_the_drives_and_time_stands_afterwards(shared: WorldProcess) -> None:
    with ExitStack() as stack:
        hand = stack.enter_context(closing(SimHand(shared.run_dir)))
        referee = stack.enter_context(closing(SimReferee(shared.run_dir)))
        before, _ = referee.look()
        hand.perform(Move(start=xy("e2"), to=xy("e4")), Withdraw())
        with pytest.raises(HandRefused, match="the hand is busy"):
            hand.perform(Withdraw())
        ended = hand.wait()
        after, _ = referee.look()
        assert 2.0 < ended - TICK * before.tick < 15.0
        pawn = next(p for p in after.pieces if p.name == "pawn")
        assert math.dist((pawn.x, pawn.y), xy("e4")) < 0.0075
        assert pawn.tilt < 0.01
        others = [(p, q) for p, q in zip(before.pieces, after.pieces, strict=True) if p.name != "pawn"]
        assert max(math.dist((p.x, p.y), (q.x, q.y)) for p, q in others) < 0.001
        assert after.hand_force == 0.0

        def stands() -> bool:
            first, _ = referee.look()
            time.sleep(0.3)
            return referee.look()[0].tick == first.tick

        until(stands)


def test_time_goes_on_for_the_hand_alone_and_stands_for_a_controller_that_waits(shared: WorldProcess) -> None:
    with closing(SimHand(shared.run_dir)) as hand:
        bus = SimServoBus(shared.run_dir)
        hand.perform(Hover(at=(0.1, 0.0), duration=0.5), Withdraw())
        ran = 0
        while not select.select([hand._link], [], [], 0.0)[0]:  # it has not said yet that it is done
            ran += not bus.exchange(BRAKED).status & DriveStatus.STANDING
        hand.wait()
        assert 1500 < ran < 12000
        stood = 0
        for _ in range(600):
            stood = stood + 1 if bus.exchange(BRAKED).status & DriveStatus.STANDING else 0
        assert stood > 20
        bus._link.close()


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        ({"actions": []}, "at least 1 item"),
        ({"actions": [{"do": "fly"}]}, "does not match any of the expected tags"),
        ({"actions": [{"do": "take", "at": [0.9, 0.0]}]}, "less than or equal to 0.36"),
        ({"actions": [{"do": "take"}]}, "Field required"),
        ({"actions": [{"do": "hover", "at": [0, 0], "duration": 1e9}]}, "less than or equal to 60"),
        ({"ask": "mercy"}, "malformed request"),
        ({"actions": [{"do": "take", "at": [0.1, 0.0]}]}, "no piece stands within 20 mm of"),
        ({"actions": [{"do": "put", "at": [0.1, 0.0]}]}, "the hand holds nothing to put down"),
    ],
)  # fmt: skip
def test_a_bad_request_is_answered_by_a_sentence(shared: WorldProcess, request_: dict[str, object], said: str) -> None:
    link, _ = wire.connect(shared.run_dir, "hand")
    with closing(link), pytest.raises(HardwareError, match=said):
        wire.ask(link, request_)


def test_a_question_is_answered_at_once(shared: WorldProcess) -> None:
    link, _ = wire.connect(shared.run_dir, "hand")
    with closing(link):
        assert wire.ask(link, {"ask": "state"}) | {"tick": 0} == {"busy": False, "holding": False, "tick": 0}


def test_a_world_without_a_hand_says_so(tmp_path: Path) -> None:
    process = WorldProcess(tmp_path, hand=None)
    try:
        with pytest.raises(HardwareError, match="this world was started without a hand: set 'hand' in its settings"):
            SimHand(tmp_path)
    finally:
        process.kill()


def test_a_hand_whose_master_is_gone_puts_the_piece_down_and_withdraws(shared: WorldProcess) -> None:
    with ExitStack() as stack:
        referee = stack.enter_context(closing(SimReferee(shared.run_dir)))
        hand = SimHand(shared.run_dir)
        hand.perform(Take(at=xy("b1")))
        hand.wait()
        held = next(p for p in referee.look()[0].pieces if p.name == "knight")
        assert held.z > 0.008
        hand.close()
        link, _ = wire.connect(shared.run_dir, "hand")
        stack.enter_context(closing(link))

        def gone() -> bool:
            state = wire.ask(link, {"ask": "state"})
            return not state["busy"] and not state["holding"]

        until(gone)
        knight = next(p for p in referee.look()[0].pieces if p.name == "knight")
        assert abs(knight.z) < 1e-4
        assert knight.tilt < 0.01
        assert math.dist((knight.x, knight.y), (held.x, held.y)) < 0.03


def test_a_world_that_ends_leaves_a_hand_that_has_withdrawn(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    world = WorldProcess(tmp_path)
    request.addfinalizer(world.kill)
    hand = SimHand(world.run_dir)
    hand.perform(Take(at=xy("e2")), Hover(at=(0.05, 0.05), duration=30.0))
    with closing(SimReferee(world.run_dir)) as referee:
        until(lambda: referee.look()[0].tick >= 3000)
    end = world.terminate()
    hand.close()
    assert end["at_rest"] is True
    with np.load(world.run_dir / STATE_FILE) as state:
        qpos = state["qpos"]
    pieces = {name: (x, y, z) for name, x, y, z, _ in map(dict.values, end["pieces"])}  # type: ignore[call-overload]
    assert abs(pieces["pawn"][2]) < 1e-4
    assert np.any(np.isclose(qpos, -0.72, atol=1e-3))  # y of the parked hand


def test_a_journal_and_a_hand_exclude_each_other() -> None:
    usual = {"pieces": (), "home": (0.0, 0.0, 0.3), "hand": {}}
    with pytest.raises(ValidationError, match="a world with a hand cannot keep one"):
        WorldSettings.model_validate({**usual, "journal": True})
