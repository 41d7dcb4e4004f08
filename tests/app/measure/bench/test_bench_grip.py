"""A king that is shaken is held; and the bench would notice if it were not."""

from __future__ import annotations

import pytest

from app.measure.bench import grip
from app.measure.bench.beds import bed
from hardware.parameters import load_parameters


def test_a_king_is_held_when_it_is_shaken() -> None:
    held = grip.shake(0)
    assert held.slip < 1e-4
    assert 1e-6 < held.creep < 1e-4, "what hangs creeps in the simulation's contacts"


def test_slippery_pads_lose_it(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_parameters()
    slippery = robot.model_copy(update={"pads": robot.pads.model_copy(update={"friction": 0.05})})
    monkeypatch.setattr(bed, "load_parameters", lambda: slippery)
    assert grip.shake(0).slip > 5e-3
