"""The text console of an emulated controller: ``conf get`` and ``conf set``, as far as drivers use them."""

from typing import Final

from hardware.sim.emulated.moteus.injected import Injected

CONFIGURATION: Final = {
    "servo.default_timeout_s": 0.1,
    "servo.timeout_mode": 12.0,
    "servo.timeout_max_torque_Nm": 5.0,
    "servo.pid_position.kp": 4.0,
    "servo.pid_position.ki": 1.0,
    "servo.pid_position.kd": 0.05,
    "servo.max_current_A": 100.0,
    "servo.fault_temperature": 75.0,
    "id.id": 1.0,
}
"""Defaults of the firmware for what is known here."""


class Console:
    """Takes text in, and keeps what it has to say until it is asked for."""

    def __init__(self, device: int, injected: Injected) -> None:
        self._device, self._injected = device, injected
        self._line, self._said = b"", b""
        self.forget()

    def forget(self) -> None:
        """What was set, and not written into its flash memory, is lost with its power."""
        self.values = {**CONFIGURATION, "id.id": float(self._device)}

    def hear(self, text: bytes) -> None:
        """Text of any length; a line is carried out at its end."""
        *lines, self._line = (self._line + text).replace(b"\r", b"\n").split(b"\n")
        for line in lines:
            if line.strip():
                self._said += self._answer(line.decode("latin-1").split()).encode() + b"\r\n"

    def say(self, most: int) -> bytes:
        """What has not been said yet, up to so many bytes."""
        said, self._said = self._said[:most], self._said[most:]
        return said

    def _answer(self, words: list[str]) -> str:
        match words:
            case ["tel" | "d", *_]:
                return "OK"
            case ["conf", "get", name] if name in self.values:
                return f"{self.values[name]:g}"
            case ["conf", "set", name, value] if name in self.values:
                try:
                    number = float(value)
                except ValueError:
                    return "ERR error setting"
                if self._injected.keeps:
                    self.values[name] = number
                return "OK"
            case ["conf", "get" | "set", *_]:
                return "ERR error setting"
            case _:
                return "ERR unknown command"
