"""A line on stderr, from a loop that must not wait for whoever reads it."""

import os
import select
from typing import Final

_STDERR = 2


def say_at_once(sentence: str) -> bool:
    """Write a line to stderr unless that would wait (a terminal that was stopped, a full pipe); whether it was said."""
    poll: Final = select.poll()
    poll.register(_STDERR, select.POLLOUT)
    try:
        if not any(events & select.POLLOUT for _, events in poll.poll(0)):
            return False
        os.write(_STDERR, f"{sentence}\n".encode())
    except OSError:
        return False  # nobody listens
    return True
