"""Bench drives: whose the time of an exchange was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.measure.bench.drives import parts_of, share_rows
from app.settings.defaults import Drives
from hardware.sim.emulated.answer_times import LONGEST, AnswerTimes, load_answer_times

MS = 1e-3


def exchanges() -> np.ndarray:
    """Three of 1 ms: began, sent, came, known [s]."""
    prompt, in_pieces, unheard = (0.0, 0.02, 0.30, 0.35), (1.0, 1.02, 1.90, 2.10), (2.2, 2.22, 4.22, 4.25)
    return MS * np.array([prompt, in_pieces, unheard])


def answers() -> np.ndarray:
    """One before the first exchange, one of the first, two of the second, none of the third."""
    return MS * np.array([(-0.5, -0.4), (0.10, 0.25), (1.10, 1.40), (1.50, 1.60), (4.23, 4.24)])


def test_what_emulated_devices_compute_is_not_the_drivers() -> None:
    parts = parts_of(exchanges(), answers())
    np.testing.assert_allclose(parts.driver, MS * np.array([0.07, 0.22, 0.05]), atol=1e-12)
    np.testing.assert_allclose(parts.devices, MS * np.array([0.15, 0.40, 0.0]), atol=1e-12)
    np.testing.assert_allclose(parts.way, MS * np.array([0.13, 0.48, 2.0]), atol=1e-12)
    np.testing.assert_allclose(parts.share + parts.devices, exchanges()[:, 3] - exchanges()[:, 0], atol=1e-12)


def test_rows_tell_how_often_an_exchange_was_late_and_whose_fault_that_was() -> None:
    rows = share_rows(Drives.MOTEUS, parts_of(exchanges(), answers()), MS, granted=True)
    late = [rows[f"moteus_{name}"].mean for name in ("late", "late_prompt_devices", "late_no_way")]
    assert late == pytest.approx([200.0 / 3.0, 100.0 / 3.0, 0.0])
    assert rows["moteus_share"].limit is not None
    assert not rows["moteus_share"].holds
    assert share_rows(Drives.MOTEUS, parts_of(exchanges(), answers()), MS, granted=False)["moteus_share"].limit is None


def test_devices_leave_their_answers_and_no_more_than_they_have_room_for(tmp_path: Path) -> None:
    times = AnswerTimes()
    for k in range(LONGEST + 3):
        times.note(float(k), k + 0.5)
    times.save(tmp_path)
    found = load_answer_times(tmp_path)
    assert found.shape == (LONGEST, 2)
    assert found[7].tolist() == [7.0, 7.5]
