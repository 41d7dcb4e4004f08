"""A tick in one compiled call: from the measurement to the torque, where nothing happens that anybody has to decide.

Nearly every tick is plain: the arm rests or follows samples that are there, and no check has anything to say. The same
compiled functions that `controller.loop.supervisor` calls one by one follow each other here. Whatever else comes, a
guard that is met, a motion's end, a limit, a sensor without a number, is left to the supervisor: the memory is put back
as it was before the tick, as if nobody had looked.

On a bus whose plant runs in the same thread many plain ticks follow each other without a line of Python; `CALLBACK` is
what such a plant calls between two of its ticks.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from controller.law.force_observer import OBSERVER_SIZE, observe
from controller.law.tare import TARE_SIZE, weigh
from controller.law.task_space import TaskSpaceController, estimate, task_space_law
from controller.loop.admission import note_peaks
from controller.loop.memory import (
    ACTING,
    CLAMP,
    ENCODERS,
    EXECUTED,
    FIRST,
    GIVEN,
    GUARDING,
    LENGTH,
    MARKED,
    OBSERVER,
    PEAKS,
    PLAYBACK,
    RECEIVED,
    REFERENCE,
    SCREEN,
    SIZE,
    TACTILE,
    TAIL,
    TARE,
    TORQUE,
    TickMemory,
)
from controller.loop.playback import PLAYBACK_SIZE, advance, follow, last_needed
from controller.model.compiled import (
    PAIR,
    ROW,
    SCALAR,
    STATUS,
    TABLE,
    VECTOR,
    WHOLE,
    WHOLES,
    FloatArray,
    IntArray,
    Vector,
    callback,
    compiled_as,
    direct,
    row_at,
    table_at,
    wholes_at,
)
from controller.model.kinematics import OK
from controller.model.state import CONSTANTS, INVERSE, POSITION, REFERENCE_SIZE, ROWS, VELOCITY
from controller.model.state import TORQUE as LAW_TORQUE
from controller.protection.encoders import ENCODERS_SIZE, watch_encoders
from controller.protection.grip_and_touch import meets
from controller.protection.limits import DRIVE_TROUBLE, clamp
from controller.protection.reference_check import COLUMNS
from controller.protection.screening import SCREEN_SIZE, arm_well, heat, joints_well
from controller.protocol.states import State
from controller.records.flight_file import FLIGHT
from hardware.interfaces import Measurement, PlantCall

_COLUMN: Final = {
    field.name: sum(before.count for before in FLIGHT.fields[:at]) for at, field in enumerate(FLIGHT.fields)
}
"""Of each field of a row, where it begins; every number has eight bytes."""
FLIGHT_COLUMNS: Final = FLIGHT.size // 8
_TICK_AT, _WALL_AT, _WORK_AT = _COLUMN["tick"], _COLUMN["wall"], _COLUMN["work"]
_STATE_AT, _CAUSE_AT, _STATUS_AT = _COLUMN["state"], _COLUMN["cause"], _COLUMN["drive_status"]
_MOTION_AT, _INDEX_AT, _ANGLE_AT, _RATE_AT = (_COLUMN[one] for one in ("motion", "index", "angle", "angle_velocity"))
_TORQUE_AT, _FINGER_AT, _OPENING_AT = _COLUMN["torque"], _COLUMN["finger_position"], _COLUMN["finger_velocity"]
_TACTILE_AT, _FORCE_AT, _TOOL_AT = _COLUMN["tactile"], _COLUMN["force"], _COLUMN["position"]
_SPEED_AT, _ASKED_AT, _REFERENCE_AT = _COLUMN["velocity"], _COLUMN["torque_asked"], _COLUMN["reference"]
STATE, CAUSE, MOTION, COUNT = range(4)
"""What the supervisor says of a tick: its state, the cause and the motion to note, and how many ticks are noted."""
_PLAIN, LOOK_CLOSER, _WAIT = 0, 1, 2
"""What a compiled tick says, see `PlantCall`."""
_TRACK: Final = int(State.TRACK)
_LAW, _BLOCK, _SAMPLES, _CAPACITY, _FLIGHT, _FLIGHTS, _SAVED, _SAID = range(8)
"""Addresses and sizes in a context."""


@compiled_as(STATUS(TABLE, ROW, SCALAR, VECTOR, VECTOR, PAIR))
def _estimate(
    law: FloatArray, block: FloatArray, tick: float, angle: Vector, velocity: Vector, said: tuple[float, float]
) -> int:
    """Sensors, force, pose and encoders."""
    tactile = weigh(block[TARE : TARE + TARE_SIZE], said, block[TAIL])
    block[TACTILE], block[TACTILE + 1] = tactile
    acting = block[ACTING], block[ACTING + 1], block[ACTING + 2]
    observe(block[OBSERVER : OBSERVER + OBSERVER_SIZE], law, velocity, acting)
    if estimate(law, angle, velocity) != OK:
        return LOOK_CLOSER
    wanted = block[REFERENCE], block[REFERENCE + 1], block[REFERENCE + 2]  # as the last tick wanted it
    encoders = block[ENCODERS : ENCODERS + ENCODERS_SIZE]
    if watch_encoders(encoders, tick, angle, velocity, wanted, law[INVERSE : INVERSE + 3]) != 0:
        return LOOK_CLOSER
    return _PLAIN if joints_well(block[SCREEN : SCREEN + SCREEN_SIZE], angle, velocity) else LOOK_CLOSER


@compiled_as(STATUS(ROW, TABLE, SCALAR))
def _follow(block: FloatArray, samples: FloatArray, tick: float) -> int:
    """Reference of this tick from the motion's sample; not where it meets its guard or its end."""
    row, tail = block[REFERENCE:TAIL], block[TAIL:TORQUE]
    playback, first, length = block[PLAYBACK : PLAYBACK + PLAYBACK_SIZE], block[FIRST], block[LENGTH]
    needed = last_needed(playback, first, length, tick)
    if needed < 0.0:
        return _PLAIN
    if needed >= block[RECEIVED]:
        return LOOK_CLOSER
    warm = heat(block[SCREEN : SCREEN + SCREEN_SIZE])
    block[EXECUTED] = advance(playback, first, length, tick, row, samples, warm)
    follow(playback, samples, row, tail)
    tactile = block[TACTILE], block[TACTILE + 1]
    met = meets(block[GUARDING:PEAKS], tail[1], tail[2], tactile, block[OBSERVER + 2])
    return LOOK_CLOSER if met != 0 or block[EXECUTED] == length else _PLAIN


@compiled_as(STATUS(TABLE, ROW, STATUS, SCALAR))
def _control(law: FloatArray, block: FloatArray, state: int, tick: float) -> int:
    """Protection by tool, fingers and motors; law and limits."""
    row, tactile = block[REFERENCE:TAIL], (block[TACTILE], block[TACTILE + 1])
    block[MARKED] = tick
    force = block[OBSERVER], block[OBSERVER + 1], block[OBSERVER + 2]
    before = block[TORQUE], block[TORQUE + 1], block[TORQUE + 2]
    if arm_well(block[SCREEN : SCREEN + SCREEN_SIZE], law, row, force, tactile, before) == 0:
        return LOOK_CLOSER
    asked = task_space_law(law, row, tactile)
    if not math.isfinite(asked[0] + asked[1] + asked[2]):
        return LOOK_CLOSER
    torque = clamp(asked, before, block[CLAMP], block[CLAMP + 1])
    if torque != asked:
        block[CLAMP + 2] += 1.0
    block[TORQUE], block[TORQUE + 1], block[TORQUE + 2] = torque
    if state == _TRACK:
        note_peaks(block[PEAKS:SIZE], torque, tactile)
    return _PLAIN


@compiled_as(STATUS(TABLE, ROW, TABLE, WHOLES, WHOLE, SCALAR, VECTOR, VECTOR, SCALAR, STATUS))
def note_row(
    law: FloatArray, block: FloatArray, flight: FloatArray, flight_wholes: IntArray, said_of: IntArray, tick: float,
    angle: Vector, velocity: Vector, finger_position: float, status: int,
) -> int:  # fmt: skip
    """The flight recorder's row of a tick that was taken in, but for its wall times; arguments as of `plain_tick`."""
    at = said_of[COUNT] % len(flight)
    said_of[COUNT] += 1
    row, whole = flight[at], flight_wholes[at]
    whole[_TICK_AT], whole[_STATUS_AT], whole[_INDEX_AT] = int(tick), status, int(block[EXECUTED])
    whole[_STATE_AT], whole[_CAUSE_AT], whole[_MOTION_AT] = said_of[STATE], said_of[CAUSE], said_of[MOTION]
    for i in range(3):
        row[_ANGLE_AT + i], row[_RATE_AT + i], row[_TORQUE_AT + i] = angle[i], velocity[i], block[TORQUE + i]
        row[_FORCE_AT + i], row[_TOOL_AT + i] = block[OBSERVER + i], law[POSITION, i]
        row[_SPEED_AT + i], row[_ASKED_AT + i] = law[VELOCITY, i], law[LAW_TORQUE, i]
    row[_FINGER_AT], row[_OPENING_AT] = finger_position, block[TAIL]
    row[_TACTILE_AT], row[_TACTILE_AT + 1] = block[TACTILE], block[TACTILE + 1]
    row[_REFERENCE_AT : _REFERENCE_AT + REFERENCE_SIZE] = block[REFERENCE:TAIL]
    return 0


@compiled_as(STATUS(TABLE, ROW, TABLE, TABLE, WHOLES, ROW, WHOLE, SCALAR, VECTOR, VECTOR, SCALAR, PAIR, STATUS))
def plain_tick(
    law: FloatArray, block: FloatArray, samples: FloatArray, flight: FloatArray, flight_wholes: IntArray,
    saved: FloatArray, said_of: IntArray, tick: float, angle: Vector, velocity: Vector, finger_position: float,
    tactile: tuple[float, float], status: int,
) -> int:  # fmt: skip
    """Take a measurement in, if it is plain.

    Args:
        law: memory of the law, shape (27, 3), in and out.
        block: of `TickMemory`, in and out.
        samples: ring of the motion's, shape (capacity, 19).
        flight: ring of the flight recorder, a row a tick; its wall times are left to the caller.
        flight_wholes: the same memory, as whole numbers.
        saved: to put law and block back from, shape (72 + `SIZE`,).
        said_of: state (HOLD or TRACK), cause and motion to note, and how many ticks are noted, (4,).
        tick: of the measurement, a whole number.
        angle: y [rad].
        velocity: ẏ [rad/s].
        finger_position: of the measurement [m].
        tactile: of the measurement, not tared [N].
        status: of the drives.

    Returns:
        0 it was plain, and the torque is known; 1 nothing has changed: look closer.
    """
    total = angle[0] + angle[1] + angle[2] + velocity[0] + velocity[1] + velocity[2] + tactile[0] + tactile[1]
    if not math.isfinite(total + finger_position) or status & DRIVE_TROUBLE:
        return LOOK_CLOSER
    flat, size = law.reshape(law.size), CONSTANTS * 3  # the constants stay
    saved[:size] = flat[:size]
    saved[size : size + SIZE] = block
    state = said_of[STATE]
    found = _estimate(law, block, tick, angle, velocity, tactile)
    if found == _PLAIN and state == _TRACK:
        found = _follow(block, samples, tick)
    if found == _PLAIN:
        found = _control(law, block, state, tick)
    if found != _PLAIN:
        flat[:size] = saved[:size]
        block[:] = saved[size : size + SIZE]
        return LOOK_CLOSER
    note_row(law, block, flight, flight_wholes, said_of, tick, angle, velocity, finger_position, status)
    return _PLAIN


def _on_measurement(measurement: int, command: int, context: int) -> int:
    """What a plant calls with the addresses of a measurement, of the command that comes next, and of a context.

    Returns:
        0 go on; 1 the measurement is for the supervisor, nothing has changed but what acts; 2 the command is known, but
        a sample that the next tick needs is not there yet.
    """
    taken, given = row_at(measurement, 11), row_at(command, 4)
    place = wholes_at(context, 1, 8)[0]
    law, block = table_at(place[_LAW], ROWS, 3), row_at(place[_BLOCK], SIZE)
    samples = table_at(place[_SAMPLES], place[_CAPACITY], COLUMNS)
    for i in range(3):  # as the supervisor's `command` does with each exchange
        block[ACTING + i] = block[GIVEN + i]
        block[GIVEN + i] = block[TORQUE + i]
    tick = taken[0]
    found = plain_tick(
        law, block, samples, table_at(place[_FLIGHT], place[_FLIGHTS], FLIGHT_COLUMNS),
        wholes_at(place[_FLIGHT], place[_FLIGHTS], FLIGHT_COLUMNS), row_at(place[_SAVED], law.size + SIZE),
        wholes_at(place[_SAID], 1, 4)[0], tick, (taken[1], taken[2], taken[3]), (taken[4], taken[5], taken[6]),
        taken[7], (taken[8], taken[9]), int(taken[10]),
    )  # fmt: skip
    if found != _PLAIN:
        return LOOK_CLOSER
    for i in range(3):
        given[i] = block[TORQUE + i]
    given[3] = block[TAIL]
    playback = block[PLAYBACK : PLAYBACK + PLAYBACK_SIZE]
    if block[LENGTH] > 0.0 and last_needed(playback, block[FIRST], block[LENGTH], tick + 1.0) >= block[RECEIVED]:
        return _WAIT
    return _PLAIN


CALLBACK: Final = callback(_on_measurement)
"""Address of `_on_measurement`; 0 where nothing is compiled."""
_plain_tick: Final = direct(plain_tick)
_note_row: Final = direct(note_row)


class FlightRing:
    """Rows of `FLIGHT`, oldest overwritten first; every page of it has been touched.

    Attributes:
        rows: shape (length,), of `FLIGHT.dtype`.
        notes: state, cause and motion to note, and how many ticks are noted, (4,).
    """

    def __init__(self, length: int) -> None:
        self.length = length
        self.floats = np.zeros((length, FLIGHT_COLUMNS))
        self.floats.fill(0.0)
        self.wholes = self.floats.view(np.int64)
        self.rows = self.floats.reshape(-1).view(FLIGHT.dtype)
        self.notes = np.zeros(4, dtype=np.int64)

    @property
    def count(self) -> int:
        """Ticks noted so far."""
        return int(self.notes[COUNT])

    @count.setter
    def count(self, ticks: int) -> None:
        self.notes[COUNT] = ticks

    def time(self, first: int, answered: float, work: float) -> None:
        """The wall times of all rows from one on: of the exchange, since 1970, and of the work after it [s]."""
        for at in range(first, self.count):
            row = self.floats[at % self.length]
            row[_WALL_AT], row[_WORK_AT] = answered, work

    def parts(self) -> list[NDArray[Any]]:
        """Rows in order of time, without a copy."""
        if self.count <= self.length:
            return [self.rows[: self.count]]
        oldest = self.count % self.length
        return [self.rows[oldest:], self.rows[:oldest]]


class PlainTick:
    """The compiled tick of one arm, with everything it works on.

    Args:
        law: whose memory it is.
        memory: of everything else.
        samples: ring of the motion's, shape (capacity, 19).

    Attributes:
        call: for a plant in the same thread.
    """

    def __init__(self, law: TaskSpaceController, memory: TickMemory, samples: FloatArray) -> None:
        self._law, self._block, self._samples = law.memory, memory.block, samples
        self._saved = np.zeros(ROWS * 3 + SIZE)
        self._context = np.zeros(8, dtype=np.int64)
        arrays = {_LAW: self._law, _BLOCK: self._block, _SAMPLES: samples, _SAVED: self._saved}
        for place, array in arrays.items():
            self._context[place] = array.ctypes.data
        self._context[_CAPACITY] = len(samples)
        self.call = PlantCall(CALLBACK, self._context.ctypes.data, np.zeros(11), np.zeros(4))
        self.note_into(FlightRing(1))

    def note_into(self, ring: FlightRing) -> None:
        """From here on note ticks there."""
        self._ring = ring
        self._context[_FLIGHT], self._context[_FLIGHTS] = ring.floats.ctypes.data, ring.length
        self._context[_SAID] = ring.notes.ctypes.data

    def say(self, state: int, cause: int, motion: int) -> None:
        """What ticks from here on are noted with."""
        self._ring.notes[:COUNT] = state, cause, motion

    def take(self, measurement: Measurement) -> bool:
        """Take a measurement in if it is plain; false, and nothing has changed, where it is not."""
        tick, angle, velocity, finger_position, tactile, status = measurement
        ring = self._ring
        return not _plain_tick(
            self._law, self._block, self._samples, ring.floats, ring.wholes, self._saved, ring.notes, float(tick),
            angle, velocity, finger_position, tactile, int(status),
        )  # fmt: skip

    def note(self, measurement: Measurement) -> None:
        """Note a tick that was not plain, once it was taken in."""
        tick, angle, velocity, finger_position, _, status = measurement
        ring = self._ring
        _note_row(
            self._law, self._block, ring.floats, ring.wholes, ring.notes, float(tick), angle, velocity, finger_position,
            int(status),
        )  # fmt: skip
