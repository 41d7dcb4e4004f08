"""What the simulated hand can be told at the keyboard."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.pieces.inventory import Inventory
from app.play.simulated_hand import SimHands
from app.players.typed_commands import CommandError, HandVerb, MoveHand, parse_hand
from hardware.interfaces import HandRefused
from hardware.table import Place, TableSettings

PLACES = st.sampled_from([f"{file}{rank}" for file in "abcdefgh" for rank in range(1, 9)] + ["L3", "R24", "BL7", "BR1"])


@given(PLACES, PLACES, st.booleans(), st.booleans())
def test_a_place_may_be_typed_in_any_case(start: str, to: str, first: bool, second: bool) -> None:
    typed = [start.upper() if first else start.lower(), to.upper() if second else to.lower()]
    assert parse_hand(["move", *typed]) == MoveHand(HandVerb.MOVE, (Place.parse(start), Place.parse(to)))


@pytest.mark.parametrize("words", [[], ["grab", "e2"], ["move", "e2"], ["knock", "e2", "e4"], ["hover", "x9"]])
def test_what_is_no_order_is_answered_with_those_that_are(words: list[str]) -> None:
    with pytest.raises(CommandError, match="say 'hand move b1 b4'"):
        parse_hand(words)


def test_a_place_that_this_table_does_not_have_is_refused(tmp_path: Path) -> None:
    order = MoveHand(HandVerb.MOVE, (Place.parse("g1"), Place.parse("R30")))
    with pytest.raises(HandRefused, match="there is no place R30: trays are L1 to L24 and R1 to R24"):
        SimHands(tmp_path).do(order, Inventory.of((), TableSettings()))
