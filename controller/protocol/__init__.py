"""The wire between the app and the controller; ``docs/protocol.md`` describes it for other languages."""

from controller.protocol.datagram_fields import (
    SAMPLE,
    SAMPLES_PER_DATAGRAM,
    VERSION,
    CommandCode,
    DatagramKind,
    Flag,
    Guard,
    MotionFlag,
    Result,
)

__all__ = [
    "SAMPLE",
    "SAMPLES_PER_DATAGRAM",
    "VERSION",
    "CommandCode",
    "DatagramKind",
    "Flag",
    "Guard",
    "MotionFlag",
    "Result",
]
