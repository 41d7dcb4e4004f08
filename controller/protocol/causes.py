"""Why the controller refused, stopped or faulted: one enum; ``cause_sentences`` has a sentence for each."""

from enum import IntEnum, unique


@unique
class Cause(IntEnum):
    """Reason of a refusal, a stop or a fault; its number goes over the wire."""

    NONE = 0
    # refusals of an announcement
    LATE = 1
    TOO_EARLY = 2
    LENGTH = 3
    OCCUPIED = 4
    NOT_HOLDING = 5
    NOT_ADMITTED = 6
    START_POSITION = 7
    START_VELOCITY = 8
    START_ACCELERATION = 9
    # a sample outside its limits: refusal before the motion started, stop afterwards
    NOT_FINITE = 20
    WORKSPACE = 21
    REACH = 22
    SPEED = 23
    DOWNWARD_SPEED = 24
    ACCELERATION = 25
    POSITION_STEP = 26
    VELOCITY_STEP = 27
    STIFFNESS = 28
    DAMPING = 29
    TACTILE_GAIN = 30
    FINGER_SPEED = 31
    GUARD = 32
    ENDS_MOVING = 33
    # stops
    HOLD_COMMAND = 40
    STOP_COMMAND = 41
    CLIENT_LOST = 42
    UNDERRUN = 43
    SHUTDOWN = 44
    UNKNOWN_EVENT = 45
    PARKED = 46
    GRIP_LOST = 47
    STOP_PRESSED = 48
    # faults
    TRACKING = 60
    MODEL = 61
    DRIVE_FAULT = 62
    WATCHDOG = 63
    OVERSPEED = 64
    NOT_ENABLED = 65
    BAD_MEASUREMENT = 66
    BAD_TORQUE = 67
    NOT_AT_REST = 68
    ENCODER = 69
    JOINT_SPEED = 70
    JOINT_RANGE = 71
    TOOL_SPEED = 72
    TOOL_OUTSIDE = 73
    PRESSING = 74
    GRIP_FORCE = 75
    TACTILE_OVERLOAD = 76
    RMS_TORQUE = 77
