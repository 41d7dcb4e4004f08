"""The maker's own library as an independent implementation: frames, lines, and a client of the emulated controllers."""

from __future__ import annotations

import asyncio
import io
import math
from pathlib import Path
from typing import Any

import moteus
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moteus import fdcanusb_device, multiplex
from moteus.protocol import Writer, parse_registers, scale_register

from hardware.drives.moteus import frames
from hardware.drives.moteus.adapter import Adapter
from hardware.drives.moteus.cycle import TURN, CommandLimits, Controller
from hardware.drives.moteus.fdcanusb import AdapterLineError, parse_frame, with_check_sum, without_check_sum
from hardware.drives.moteus.registers import Mode, Register, Resolution, analog, raw_of, value_of
from hardware.drives.moteus.serial_port import SerialPort
from hardware.drives.moteus.settings import MoteusSettings
from tests.hardware.drives.moteus.emulator import STILL, Emulator, emulated

RESOLUTIONS = st.sampled_from(Resolution)
VALUES = st.one_of(st.just(math.nan), st.floats(-1e6, 1e6, width=32))
LIMITS = CommandLimits(8.0, 0.044)
COMMAND = {
    "position": Register.COMMAND_POSITION,
    "velocity": Register.COMMAND_VELOCITY,
    "feedforward_torque": Register.COMMAND_TORQUE,
    "kp_scale": Register.COMMAND_KP_SCALE,
    "kd_scale": Register.COMMAND_KD_SCALE,
    "maximum_torque": Register.COMMAND_MAX_TORQUE,
    "stop_position": Register.COMMAND_STOP_POSITION,
    "watchdog_timeout": Register.COMMAND_TIMEOUT,
    "ilimit_scale": Register.COMMAND_ILIMIT_SCALE,
}
"""Fields of a position command, as the library calls them."""
SMALL_GAINS = moteus.PositionResolution()
SMALL_GAINS.kp_scale = SMALL_GAINS.kd_scale = SMALL_GAINS.ilimit_scale = multiplex.INT8
"""As this driver sends them."""


def same(one: float, other: float) -> bool:
    return one == pytest.approx(other, rel=1e-6, abs=1e-9, nan_ok=True)


# -------------------------------------------------------------------------------------------------------------- frames


@given(st.dictionaries(st.sampled_from(sorted(COMMAND)), st.tuples(RESOLUTIONS, VALUES), max_size=len(COMMAND)))
def test_a_position_command_of_the_library_is_ours_byte_by_byte(fields: dict[str, tuple[Resolution, float]]) -> None:
    resolutions = moteus.PositionResolution()
    for name, (resolution, _) in fields.items():
        setattr(resolutions, name, int(resolution))
    theirs = moteus.Controller(id=1, position_resolution=resolutions).make_position(
        **{name: value for name, (_, value) in fields.items()}
    )
    ours = frames.write(Resolution.INT8, Register.MODE, [Mode.POSITION])
    written = sorted((COMMAND[name], resolution, value) for name, (resolution, value) in fields.items())
    runs: list[list[tuple[Register, Resolution, float]]] = []
    for one in written:
        if runs and (runs[-1][-1][0] + 1, runs[-1][-1][1]) == one[:2]:
            runs[-1].append(one)
        else:
            runs.append([one])
    for run in runs:
        ours += frames.write(run[0][1], run[0][0], [raw_of(*one) for one in run])
    assert ours == theirs.data
    parts = [part for part in frames.parse(theirs.data) if part.register != Register.MODE]
    assert [(part.register, part.resolution) for part in parts] == [one[:2] for one in written]
    said = parse_registers(theirs.data).command
    for part in parts:
        assert same(value_of(part.register, part.resolution, part.value), said[part.register])


@given(st.dictionaries(st.sampled_from([*Register]), RESOLUTIONS, min_size=1, max_size=12))
def test_a_query_of_the_library_asks_what_we_read_in_it(asked: dict[Register, Resolution]) -> None:
    theirs = moteus.Controller(id=1).make_custom_query({int(one): int(kind) for one, kind in asked.items()}).data
    parts = list(frames.parse(theirs))
    assert {part.part for part in parts} == {frames.SubframeKind.READ}
    assert {part.register: part.resolution for part in parts} == asked
    ours = b"".join(frames.read(kind, one) for one, kind in sorted(asked.items()))
    assert parse_registers(ours).query == parse_registers(theirs).query


@given(
    register=st.sampled_from([*Register, *(analog(aux, pin) for aux in (1, 2) for pin in range(5))]),
    resolution=RESOLUTIONS,
    values=st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=15),
)
def test_an_answer_of_ours_means_to_the_library_what_it_means_to_us(
    register: int, resolution: Resolution, values: list[float]
) -> None:
    largest = {Resolution.INT8: 128, Resolution.INT16: 32768, Resolution.INT32: 2147483648, Resolution.FLOAT: 100.0}
    raw = [max(-largest[resolution], value * largest[resolution] - 0.5) for value in values]
    data = frames.padded(frames.reply(resolution, register, raw[: 60 // (4 if resolution > 1 else resolution + 1)]))
    parts = list(frames.parse(data))
    theirs = parse_registers(data).response
    assert sorted({part.register for part in parts}) == sorted(theirs)
    for part in parts:
        known = part.register in set(Register) or any(part.register == analog(a, p) for a in (1, 2) for p in range(5))
        if known and part.register not in {Register.SET_OUTPUT_NEAREST, Register.SET_OUTPUT_EXACT}:  # write only
            ours, said = value_of(part.register, part.resolution, part.value), theirs[part.register]
            assert same(int(ours) if isinstance(said, int) else ours, said)


@given(st.integers(0, 0x158), st.integers(0, 200), st.binary(max_size=61))
def test_errors_and_text_are_read_alike(register: int, number: int, text: bytes) -> None:
    assert parse_registers(frames.read_error(register, number)).errors == [(register, number)]
    client = moteus.Controller(id=1)
    assert frames.text_in(text) == client.make_diagnostic_write(text).data
    assert frames.poll(48) == client.make_diagnostic_read(48).data
    said = list(multiplex.parse_frame(frames.text_out(text)))
    assert [(one.channel, one.data) for one in said] == [(1, text)]


# ---------------------------------------------------------------------------------------------------- frames of a tick


def data_of(line: bytes) -> bytes:
    return parse_frame(line, b"can send").data


@given(st.floats(-8.0, 8.0, width=32), st.floats(-50.0, 50.0))
def test_the_frames_of_every_tick_are_the_librarys(torque: float, angle: float) -> None:
    ours, theirs = Controller(3, LIMITS), moteus.Controller(id=3, position_resolution=SMALL_GAINS)
    held = {"watchdog_timeout": LIMITS.timeout, "maximum_torque": LIMITS.torque, "query": True}
    free = {"position": math.nan, "velocity": 0.0, "feedforward_torque": torque}
    turning = {"position": math.nan, "velocity": angle / TURN, "feedforward_torque": 0.0}
    still = {"position": angle / TURN, "velocity": 0.0, "feedforward_torque": 0.0}
    for line, command in (
        (ours.torque(torque), theirs.make_position(**free, **held, kp_scale=0.0, kd_scale=0.0, ilimit_scale=0.0)),
        (ours.velocity(angle), theirs.make_position(**turning, **held, kp_scale=1.0, kd_scale=1.0, ilimit_scale=1.0)),
        (ours.hold(angle), theirs.make_position(**still, **held, kp_scale=1.0, kd_scale=1.0, ilimit_scale=1.0)),
        (ours.mode(Mode.STOPPED), theirs.make_stop(query=True)),
        (ours.mode(Mode.BRAKE), theirs.make_brake(query=True)),
    ):
        assert data_of(line) == frames.padded(command.data)
        assert parse_frame(line, b"can send").id == frames.address(command.destination)


@given(
    st.tuples(*[st.floats(-30.0, 30.0, width=32)] * 3),
    st.tuples(st.integers(0, 15), st.integers(-127, 127), st.integers(-128, 127), st.integers(0, 105)),
    st.floats(-1.0, 1.0),
)
def test_answers_that_the_library_encodes_are_read(
    state: tuple[float, ...], small: tuple[int, ...], share: float
) -> None:
    mode, volts, degrees, code = small
    buffer = io.BytesIO()
    writer = Writer(buffer)

    def group(first: int, resolution: int, values: tuple[float, ...]) -> None:
        combiner = multiplex.WriteCombiner(writer, multiplex.REPLY_BASE, first, [resolution] * len(values))
        for value in values:
            combiner.maybe_write()
            writer.write(value, resolution)

    group(Register.MODE, multiplex.INT8, (mode,))
    group(Register.POSITION, multiplex.F32, state)
    group(Register.VOLTAGE, multiplex.INT8, (volts, degrees, code))
    combiner = multiplex.WriteCombiner(writer, multiplex.REPLY_BASE, analog(2, 1), [multiplex.INT16])
    combiner.maybe_write()
    writer.write_pwm(share, multiplex.INT16)
    told = Controller(1, LIMITS, [analog(2, 1)]).read(frames.padded(buffer.getvalue()))
    said = parse_registers(buffer.getvalue()).response
    assert (told.mode, told.code) == (said[Register.MODE], said[Register.FAULT])
    assert same(told.angle / TURN, said[Register.POSITION])
    assert same(told.velocity / TURN, said[Register.VELOCITY])
    assert same(told.torque, said[Register.TORQUE])
    assert same(told.voltage, said[Register.VOLTAGE])
    assert same(told.temperature, said[Register.TEMPERATURE])
    assert same(told.inputs[0], said[analog(2, 1)])


# --------------------------------------------------------------------------------------------------------------- lines


@given(st.binary(max_size=80).filter(lambda line: not set(b"\r\n") & set(line)))
def test_check_sums_are_the_librarys(line: bytes) -> None:
    summed = with_check_sum(line)
    assert summed == fdcanusb_device._append_checksum(line)
    assert fdcanusb_device._strip_and_validate_checksum(summed) == (without_check_sum(summed)[0], True, True)


@given(st.binary(max_size=40), st.sampled_from([b"*", b" *", b""]), st.binary(min_size=2, max_size=2))
def test_lines_that_only_look_checked_are_taken_alike(line: bytes, star: bytes, tail: bytes) -> None:
    stripped, summed, good = fdcanusb_device._strip_and_validate_checksum(line + star + tail)
    if summed and not good:
        with pytest.raises(AdapterLineError, match="wrong check sum"):
            without_check_sum(line + star + tail)
    else:
        assert without_check_sum(line + star + tail) == (stripped, summed)


# -------------------------------------------------------------------------------------------------------- as a client

SETTINGS = MoteusSettings()


@pytest.fixture
def emulator(tmp_path: Path) -> Any:
    with emulated(tmp_path, SETTINGS) as one:
        yield one


async def play(port: Path) -> list[dict[int, Any]]:
    """A client's session: commands and queries, and what the controllers answer."""
    said: list[dict[int, Any]] = []
    with_position = moteus.QueryResolution()
    async with moteus.Fdcanusb(str(port)) as transport:
        one, gripper = (moteus.Controller(id=device, transport=transport) for device in (2, 4))

        async def ask(command: Any) -> dict[int, Any]:
            (result,) = await transport.cycle([command])
            said.append(result.values)
            return said[-1]

        await ask(one.make_stop(query=True))
        for _ in range(100):  # enabling takes a moment
            feed = one.make_position(
                position=math.nan, velocity=0.0, feedforward_torque=0.75, kp_scale=0.0, kd_scale=0.0,
                maximum_torque=3.0, watchdog_timeout=math.nan, query_override=with_position,
            )  # fmt: skip
            if (await ask(feed))[Register.MODE] == Mode.POSITION:
                break
        await ask(one.make_query())
        await asyncio.sleep(0.02)
        await ask(one.make_query())
        await ask(one.make_brake(query=True))
        await ask(gripper.make_query())
        await ask(gripper.make_custom_query({int(Register.MODEL_NUMBER): multiplex.INT32, 0x1F0: multiplex.INT32}))
        stream = moteus.Stream(one, use_flow_control=False)
        answer = await stream.command(b"conf get servo.default_timeout_s", allow_any_response=True)
        said.append({0: answer})
        await stream.command(b"conf set servo.default_timeout_s 0.25")
        said.append({0: await stream.command(b"conf get servo.default_timeout_s", allow_any_response=True)})
        with pytest.raises(moteus.CommandError, match="ERR"):
            await stream.command(b"conf set servo.nothing 1")
        await ask(one.make_stop(query=True))
    return said


@pytest.mark.real_time
def test_the_library_drives_the_emulated_controllers_and_sees_what_our_driver_sees(emulator: Emulator) -> None:
    said = asyncio.run(play(emulator.port))
    *_, before, driven, shorted, gripper, model, first, second, stopped = said
    assert said[0][Register.MODE] == stopped[Register.MODE] == Mode.STOPPED
    assert before[Register.MODE] == driven[Register.MODE] == Mode.POSITION
    assert driven[Register.TORQUE] == pytest.approx(0.75)
    assert driven[Register.POSITION] == pytest.approx(STILL.angle[1] / TURN, rel=1e-6)
    assert driven[Register.VOLTAGE] == 24.0
    assert driven[Register.TEMPERATURE] == 30.0
    assert shorted[Register.MODE] == Mode.BRAKE
    assert gripper[Register.MODE] == Mode.STOPPED
    assert model == {Register.MODEL_NUMBER: 0x0411}, "a register that does not exist has no answer"
    assert (float(first[0]), float(second[0])) == (0.1, 0.25)
    port = SerialPort(emulator.port)
    try:
        adapter = Adapter(port, check_sums=False)
        assert adapter.configured(2, "servo.default_timeout_s") == 0.25
        for register in (Register.MODE, Register.POSITION, Register.VELOCITY, Register.VOLTAGE, Register.TEMPERATURE):
            ours = adapter.register(2, register, Resolution.FLOAT)
            assert same(ours, scale_register(register, multiplex.F32, stopped[register]))
    finally:
        port.close()
