"""Ticks of the plant, compiled: MuJoCo's step, what encoders, fingers and skin make of it, and whether all rests.

Called from Python one after the other, reading and filtering takes as long as the physics. MuJoCo's own ``mj_step`` is
called by its address, on the very model and data that Python sees. A controller in the same thread may be called by its
address, too: then many ticks follow each other without a line of Python, also while servos of others follow strokes.

All of it stands in one file, whose date tells Numba whether what it has compiled is of today.
"""

import ctypes
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import mujoco
import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from hardware.interfaces import DriveStatus
from hardware.loading import spare_blas

spare_blas()

Array = NDArray[np.float64]
Wholes = NDArray[np.int64]

COUNTS: Final = slice(0, 3)
TOUCH: Final = slice(6, 8)
PEAK_SQUARED: Final = 8
FASTEST: Final = 9
ARM_SPEED: Final = 10
RESTING: Final = 11
HAND_PEAK: Final = 12
ENCODER_NOISE: Final = 2
"""Of the sensors' noise: those of the right and the left pad [N] come first, then the three encoders' [counts] …"""
FINGER_NOISE: Final = 5
"""… and that of the fingers' position [m]; six columns."""
MEMORY: Final = 13
"""What a tick remembers: encoder counts, speeds [rad/s], lagging forces on the right and left pad [N], the square of
the largest contact force so far [N²], the fastest servomotor [rad/s], the fastest joint of arm and gripper
[rad/s, m/s], for how many ticks all has been at rest, and the largest force on the skin of a hand so far [N]."""

REST_SPEED: Final = 2e-4
"""All joints of arm and gripper slower than this [rad/s, m/s] count as resting."""
PIECE_REST_SPEED: Final = 2e-3
"""An awake piece, held or about to sleep, slower than this counts as resting [m/s] …"""
PIECE_REST_TURNING: Final = 0.02
"""… if it also turns more slowly than this [rad/s]. A piece that is gripped while it stands never comes quite to rest:
its contacts are more than it needs, and the solver lets it tremble by up to 0.007 rad/s."""
HEAP_REST_SPEED: Final = 5e-3
HEAP_REST_TURNING: Final = 0.3
"""The same of a piece in a box [m/s, rad/s]: on bare wood one of some hundred that fell on others trembled for
good, by up to 0.2 rad/s about the points that held it, and went nowhere; on a lining none was seen to."""
REST_TICKS: Final = 25
"""Everything must have been resting for so long."""
_SATURATED: Final = int(DriveStatus.SATURATED)


class ServoStrokes(NamedTuple):
    """What servos follow, each one of n channels; all arrays in one piece.

    A stroke follows the minimum-jerk law (Flash and Hogan 1985). Strokes add up, and one may begin before another has
    ended (Flash and Henis 1991).
    """

    places: Wholes
    """Of each servo its control among MuJoCo's, and its channel, (s, 2); none where nothing moves."""
    lead: Array
    """What each servo is told ahead, so that it does not lag: times velocity [s] and acceleration [s²], (s, 2)."""
    start: Array
    """Of the channels, before all strokes, (n,)."""
    strokes: Array
    """Of each its begin, its duration, both counted from the start [s], and its change of the channels, (m, 2 + n)."""
    clock: Array
    """Last tick before the start, length of a tick [s], and the time up to which these strokes count [s], (3,)."""


NOTHING = ServoStrokes(np.zeros((0, 2), np.int64), np.zeros((0, 2)), np.zeros(0), np.zeros((0, 2)), np.zeros(3))
"""No servo is led."""


class Places(NamedTuple):
    """Where a tick finds its numbers in MuJoCo's arrays of positions, velocities and sensor readings."""

    servo_angles: Sequence[int]
    """Of the servomotors, among the positions, (3,)."""
    fingers: Sequence[int]
    """Of both fingers, among the positions, (2,)."""
    joints: Sequence[int]
    """Of arm and gripper, among the velocities."""
    forces: Sequence[int]
    """Where contact forces begin, right and left finger first, among the readings."""
    touched: Sequence[int]
    """Where contact forces on a hand begin, the same."""
    skin: Sequence[int]
    """How far its skin is pressed in, the same, (3,)."""
    pieces: Sequence[tuple[int, int]]
    """Of each piece, where its position and where its velocity begins."""


class Addresses(NamedTuple):
    """``Places`` as arrays of addresses."""

    servos: Wholes
    fingers: Wholes
    joints: Wholes
    forces: Wholes
    touched: Wholes
    skin: Wholes
    pieces: Wholes


def found(places: Places) -> Addresses:
    """As compiled functions take them; a list may be empty."""
    servos, fingers, joints, forces, touched, skin, pieces = (np.array(row, dtype=np.int64) for row in places)
    return Addresses(servos, fingers, joints, forces, touched, skin, pieces.reshape(-1, 2))


def step_address() -> int:
    """Address of ``mj_step`` in the library that the Python package has loaded."""
    library = next(Path(mujoco.__file__).parent.glob("libmujoco.so*"))
    address = ctypes.cast(ctypes.CDLL(str(library)).mj_step, ctypes.c_void_p).value
    assert address is not None
    return address


@intrinsic
def _call_step(_typing: Any, step: Any, model: Any, data: Any) -> Any:
    """``step(model, data)``, all three being addresses."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        function, first, second = arguments
        kind = ir.FunctionType(ir.VoidType(), [first.type, second.type])
        builder.call(builder.inttoptr(function, kind.as_pointer()), [first, second])
        return context.get_dummy_value()

    return types.void(step, model, data), generate


@intrinsic
def _call(_typing: Any, function: Any, first: Any, second: Any, third: Any) -> Any:
    """What ``function(first, second, third)`` returns, all being addresses."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        whole = ir.IntType(64)
        kind = ir.FunctionType(whole, [whole, whole, whole])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), list(arguments[1:]))

    return types.int64(function, first, second, third), generate


_FLOATS, _TABLE = types.float64[::1], types.float64[:, ::1]
_WHOLES, _PAIRS = types.int64[::1], types.int64[:, ::1]
_SERVO_STROKES = types.NamedTuple((_PAIRS, _TABLE, _FLOATS, _TABLE, _FLOATS), ServoStrokes)  # type: ignore[no-untyped-call]
_PLACES = types.NamedTuple((*[_WHOLES] * 6, _PAIRS), Addresses)  # type: ignore[no-untyped-call]
_TRIPLE = types.UniTuple(types.float64, 3)  # type: ignore[no-untyped-call]
_STRETCH = types.UniTuple(types.int64, 2)  # type: ignore[no-untyped-call]


@numba.njit(types.void(_FLOATS, _FLOATS, _PLACES, _FLOATS, _TABLE, _FLOATS), cache=True)
def watch_rest(
    positions: Array, velocities: Array, places: Addresses, scale: Array, boxes: Array, memory: Array
) -> None:
    """Count the ticks for which all has been at rest: the arm by joint, pieces by their velocities times ``scale``.

    Pieces that sleep have no velocity. ``boxes`` are those in which pieces may tremble: x, y, half sizes, (n, 4).
    """
    quiet = memory[ARM_SPEED] < REST_SPEED
    if quiet:
        fastest = 0.0
        for i in range(len(velocities)):
            fastest = max(fastest, abs(velocities[i]) * scale[i])
        quiet = fastest < PIECE_REST_SPEED
        if not quiet and len(boxes) > 0:
            calm = scale.copy()
            for k in range(len(places.pieces)):
                x, y = positions[places.pieces[k, 0]], positions[places.pieces[k, 0] + 1]
                for box in boxes:
                    if abs(x - box[0]) <= box[2] and abs(y - box[1]) <= box[3]:
                        at = places.pieces[k, 1]
                        calm[at : at + 3] *= PIECE_REST_SPEED / HEAP_REST_SPEED
                        calm[at + 3 : at + 6] *= PIECE_REST_TURNING / HEAP_REST_TURNING
                        break
            fastest = 0.0
            for i in range(len(velocities)):
                fastest = max(fastest, abs(velocities[i]) * calm[i])
            quiet = fastest < PIECE_REST_SPEED
    memory[RESTING] = memory[RESTING] + 1.0 if quiet else 0.0


@numba.njit(
    types.void(types.int64, types.int64, types.int64, types.int64, _FLOATS, _FLOATS, _FLOATS, _PLACES, _FLOATS, _FLOATS,
               _TABLE, _FLOATS, _FLOATS), cache=True,
)  # fmt: skip
def advance(
    step: int, model: int, data: int, steps: int, positions: Array, velocities: Array, sensors: Array,
    places: Addresses, constants: Array, scale: Array, boxes: Array, memory: Array, noise: Array,
) -> None:  # fmt: skip
    """One tick of so many steps, by the addresses of ``mj_step``, of MuJoCo's model and of its data.

    ``constants`` are of ``constants_of``; ``scale`` and ``boxes`` of ``watch_rest``; ``memory`` is changed, as
    ``MEMORY`` says. ``noise`` is the sensors' at the end of this tick, (6,).
    """
    for _ in range(steps):
        _call_step(step, model, data)  # type: ignore[call-arg]  # the first is the compiler's
    scale_, speed, lag = constants[0], constants[1], constants[2]
    fastest = 0.0
    for i in range(3):
        count = np.rint(positions[places.servos[i]] * scale_ + noise[ENCODER_NOISE + i])
        memory[3 + i] = (count - memory[i]) * speed
        memory[i] = count
        fastest = max(fastest, abs(memory[3 + i]))
    memory[FASTEST] = fastest
    quickest = 0.0
    for i in range(len(places.joints)):
        quickest = max(quickest, abs(velocities[places.joints[i]]))
    memory[ARM_SPEED] = quickest
    # a finger's sensor sits behind its pad and feels the force along the finger axis, pressing positive
    forces = places.forces
    memory[6] += lag * (max(0.0, -sensors[forces[0]]) - memory[6])
    memory[7] += lag * (max(0.0, sensors[forces[1]]) - memory[7])
    for i in range(len(forces)):
        at = forces[i]
        squared = sensors[at] ** 2 + sensors[at + 1] ** 2 + sensors[at + 2] ** 2
        memory[PEAK_SQUARED] = max(memory[PEAK_SQUARED], squared)
    for i in range(len(places.touched)):
        at = places.touched[i]
        if sensors[at] != 0.0 or sensors[at + 1] != 0.0 or sensors[at + 2] != 0.0:
            x, y, z = sensors[places.skin[0]], sensors[places.skin[1]], sensors[places.skin[2]] + constants[4]
            felt = constants[3] * math.sqrt(x * x + y * y + z * z)
            memory[HAND_PEAK] = max(memory[HAND_PEAK], felt)
    watch_rest(positions, velocities, places, scale, boxes, memory)


def constants_of(encoder_bits: int, tick: float, bandwidth: float, skin: tuple[float, float]) -> Array:
    """Encoder counts for each rad, rad/s for each count in a tick [s], share in a tick of a bandwidth's lag [rad/s],
    stiffness of a hand's skin [N/m], and how far its own weight presses it in [m].
    """
    counts = 2.0**encoder_bits / (2.0 * math.pi)
    return np.array([counts, 1.0 / (counts * tick), 1.0 - math.exp(-bandwidth * tick), *skin])


@numba.njit(types.float64(types.float64, types.int64, _FLOATS, _FLOATS), cache=True)
def _rippled(asked: float, i: int, memory: Array, ripples: Array) -> float:
    """Of one motor."""
    turns = ripples[2] * (memory[i] * ripples[3])
    share = ripples[0] * math.sin(6.0 * turns + ripples[4 + 2 * i])
    made: float = asked * (1.0 + share) + ripples[1] * math.sin(12.0 * turns + ripples[5 + 2 * i])
    return made


@numba.njit(_TRIPLE(_TRIPLE, _FLOATS, _FLOATS), cache=True)
def rippled(asked: tuple[float, float, float], memory: Array, ripples: Array) -> tuple[float, float, float]:
    """What the servomotors make of a torque [N m] at the angles that the encoders say.

    ``ripples``: amplitude as a share of the torque, that of cogging [N m], pole pairs, rad for each encoder count, then
    the phases of ripple and cogging of each motor [rad], (10,).
    """
    return (
        _rippled(asked[0], 0, memory, ripples),
        _rippled(asked[1], 1, memory, ripples),
        _rippled(asked[2], 2, memory, ripples),
    )


@numba.njit(types.void(_FLOATS, _TABLE, types.float64, _TABLE), cache=True)
def add_up(start: Array, strokes: Array, time: float, out: Array) -> None:
    """Position, velocity and acceleration of the channels at a time [s] go to ``out``, (3, n); see `ServoStrokes`."""
    channels = len(start)
    out[0], out[1], out[2] = start, 0.0, 0.0
    for k in range(len(strokes)):
        t = strokes[k, 1]
        s = (time - strokes[k, 0]) / t
        if s <= 0.0:
            continue
        change = strokes[k, 2:]
        if s >= 1.0:
            for i in range(channels):
                out[0, i] += change[i]
            continue
        rest = 1.0 - s
        place = s * s * s * (10.0 + s * (6.0 * s - 15.0))
        speed = 30.0 * s * s * rest * rest / t
        push = 60.0 * s * rest * (1.0 - 2.0 * s) / (t * t)
        for i in range(channels):
            out[0, i] += change[i] * place
            out[1, i] += change[i] * speed
            out[2, i] += change[i] * push


@numba.njit(types.float64(_SERVO_STROKES, types.float64), cache=True)
def time_at(followed: ServoStrokes, tick: float) -> float:
    """Since the start, at the end of a tick that comes [s]."""
    clock = followed.clock
    elapsed: float = (tick - clock[0] + 1.0) * clock[1]
    return elapsed


@numba.njit(types.boolean(_SERVO_STROKES, types.float64), cache=True)
def over(followed: ServoStrokes, tick: float) -> Any:
    """Whether something else is to be followed from a tick on."""
    return time_at(followed, tick) > followed.clock[2]


@numba.njit(types.void(_SERVO_STROKES, types.float64, _FLOATS), cache=True)
def follow(followed: ServoStrokes, tick: float, controls: Array) -> None:
    """Set the servos for a tick that comes, in MuJoCo's controls."""
    told = np.empty((3, len(followed.start)))
    add_up(followed.start, followed.strokes, time_at(followed, tick), told)
    for k in range(len(followed.places)):
        i = followed.places[k, 1]
        ahead = followed.lead[k, 0] * told[1, i] + followed.lead[k, 1] * told[2, i]
        controls[followed.places[k, 0]] = told[0, i] + ahead


@numba.njit(
    _STRETCH(
        types.int64, types.int64, types.int64, types.int64, _FLOATS, _FLOATS, _FLOATS, _FLOATS, _PLACES, _FLOATS,
        _FLOATS, _TABLE, _FLOATS, _TABLE, _FLOATS, _FLOATS, types.int64, types.int64, types.int64, _FLOATS, _FLOATS,
        _TABLE, _SERVO_STROKES, types.boolean,
    ), cache=True,
)  # fmt: skip
def run(
    step: int, model: int, data: int, steps: int, positions: Array, velocities: Array, sensors: Array, controls: Array,
    places: Addresses, constants: Array, scale: Array, boxes: Array, memory: Array, noise: Array, ripples: Array,
    drives: Array, most: int, function: int, context: int, measurement: Array, command: Array, applied: Array,
    followed: ServoStrokes, until_rest: bool,
) -> tuple[int, int]:  # fmt: skip
    """Ticks one after the other, each as ``Plant.measure``, ``.apply`` and ``.step`` would do it, with enabled drives.

    ``step`` to ``sensors`` and ``places`` to ``memory`` are as of ``advance``; ``controls`` are MuJoCo's, for the
    servomotors' torques and the fingers. ``noise`` is the sensors', by tick modulo its length, (n, 6); ``ripples`` are
    of ``rippled``, the first two 0 where there are none. ``drives``: tick, status without SATURATED, 1 if that was in
    the last command's, peak torque [N m], speed at which the drives trip [rad/s], and ``Obedience`` of the gripper's
    motor, a tick beyond which is not begun, (8,); tick and third change. Of ``function``, ``context``, ``measurement``
    and ``command`` see ``PlantCall``; ``applied`` are the commands as they were applied, (most, 4); ``followed`` is
    what other servos follow: the tick in which that is over is not begun. ``until_rest``: end with the tick in which
    all has been at rest for long enough.

    Returns:
        How many ticks, and what the function returned last.
    """
    ran = said = 0
    scale_, led = 1.0 / constants[0], len(followed.places) > 0
    while ran < most and not (led and over(followed, drives[0])):
        gripped = min(memory[6], memory[7])
        if not (drives[5] < gripped <= drives[6] and drives[0] < drives[7]):
            break
        row = noise[int(drives[0]) % len(noise)]
        measurement[0] = drives[0]
        for i in range(3):
            measurement[1 + i], measurement[4 + i] = memory[i] * scale_, memory[3 + i]
        measurement[7] = 0.5 * (positions[places.fingers[0]] + positions[places.fingers[1]]) + row[FINGER_NOISE]
        measurement[8], measurement[9] = memory[6] + row[0], memory[7] + row[1]
        measurement[10] = drives[1] + (_SATURATED if drives[2] != 0.0 else 0)
        u = command[0], command[1], command[2]
        drives[2] = 1.0 if max(abs(u[0]), abs(u[1]), abs(u[2])) > drives[3] else 0.0
        applied[ran] = command
        if ripples[0] != 0.0 or ripples[1] != 0.0:
            u = rippled(u, memory, ripples)
        controls[0], controls[1], controls[2], controls[3] = u[0], u[1], u[2], command[3]
        if led:
            follow(followed, drives[0], controls)
        drives[0] += 1.0
        now = noise[int(drives[0]) % len(noise)]
        advance(step, model, data, steps, positions, velocities, sensors, places, constants, scale, boxes, memory, now)
        ran += 1
        said = _call(function, measurement.ctypes.data, command.ctypes.data, context)  # type: ignore[call-arg]
        if said != 0 or memory[FASTEST] > drives[4] or (until_rest and memory[RESTING] >= REST_TICKS):
            break
    return ran, said
