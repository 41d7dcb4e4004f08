"""From what stands on the table to what shall stand there, by as few transfers as it takes.

``order`` turns one inventory into another, ``position`` chooses which piece stands on which square. Pure, as
:mod:`app.manipulation` is. Errors, beside that module's::

    UserError
    ├── PiecesMissing      board and trays do not hold what the position needs
    ├── PlacesMissing      trays and boxes do not hold what has to leave the board
    └── NowhereAside       pieces block each other in a ring, and no place is free to step aside to
"""

from app.rearrange.order import NowhereAside, rearrange
from app.rearrange.position import PiecesMissing, PlacesMissing, arranged, set_up

__all__ = ["NowhereAside", "PiecesMissing", "PlacesMissing", "arranged", "rearrange", "set_up"]
