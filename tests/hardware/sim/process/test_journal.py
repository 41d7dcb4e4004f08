"""A journal holds all that a plant's drives were told: done again, it leads to the same state, to the last bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hardware.interfaces import Command, HardwareError
from hardware.parameters import load_parameters
from hardware.sim.bodies.scene import build_model
from hardware.sim.plant.plant import Plant
from hardware.sim.process.journal import JOURNAL_FILE, Journal, Replay
from hardware.table import TableSettings

PARAMETERS = load_parameters()
HOME = np.array((0.0, 0.075, 0.325))


def plant() -> Plant:
    return Plant(build_model(PARAMETERS, TableSettings(), (), HOME, looks=False), PARAMETERS, ())


def test_a_journal_done_again_ends_in_the_same_state(tmp_path: Path) -> None:
    rng, first, journal = np.random.default_rng(3), plant(), Journal()
    for tick in range(600):
        command: Command | None = None
        if tick == 300:
            first.trip_watchdog()
            journal.tripped()
        if tick % 7:  # else the last one stays in force
            torque = rng.uniform(-2.0, 1.0, 3).tolist()
            enable = not 340 < tick < 350  # which clears what tripped
            command = Command((torque[0], torque[1], torque[2]), 0.05, brake=False, enable=enable, busy=True)
            first.apply(command)
        first.step()
        journal.ran(command)
    journal.write(tmp_path)
    second, replay = plant(), Replay(tmp_path)
    assert len(replay) == 600
    replay.run(second)
    assert second.digest() == first.digest()
    assert second.tick == 600


def test_a_journal_that_is_missing_or_cut_off_is_refused_in_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(HardwareError, match=r"no journal at .*commands\.bin"):
        Replay(tmp_path)
    (tmp_path / JOURNAL_FILE).write_bytes(bytes(36))
    with pytest.raises(HardwareError, match="it was cut off"):
        Replay(tmp_path)
