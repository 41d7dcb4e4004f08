"""The game: chess, manipulation, motion, records and people. The only room that may import every other one."""

from __future__ import annotations


class UserError(Exception):
    """Something whoever started the program can mend; the message is one sentence with the remedy.

    The command line prints the message without a traceback. Errors that are no ``UserError`` are bugs or failures of
    devices.
    """
