"""What can be asked of a dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.dataset.wish import RATES, SIDES, DatasetWish

WHERE: dict[str, Any] = {"source": Path("game"), "output": Path("set")}


@given(st.sampled_from(["width", "height"]), st.integers(-10, 10_000))
def test_sides_are_even_and_what_codecs_take(side: str, length: int) -> None:
    if length % 2 == 0 and SIDES[0] <= length <= SIDES[1]:
        assert getattr(DatasetWish(**WHERE, **{side: length}), side) == length
    else:
        with pytest.raises(ValueError, match=f"a side of {length} px cannot be"):
            DatasetWish(**WHERE, **{side: length})


@pytest.mark.parametrize("rate", [RATES[0] - 1, RATES[1] + 1])
def test_rates_are_those_of_signals(rate: int) -> None:
    with pytest.raises(ValueError, match=f"{rate} frames a second cannot be, there are 1 to 1000"):
        DatasetWish(**WHERE, fps=rate)
