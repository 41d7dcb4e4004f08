"""What can go wrong between two robots.

LinkError (UserError)
├── LinkRefused     one end does not accept the other: secret, certificate, version, or another game
└── LinkBroken      what arrived is not what the other robot can have sent; the connection is given up
"""

from __future__ import annotations

from app import UserError


class LinkError(UserError):
    """The link cannot be made; one sentence with the next step."""


class LinkRefused(LinkError):
    """One end does not accept the other."""


class LinkBroken(LinkError):
    """A line was changed, repeated, out of order, too long, or means nothing: the connection is given up at once."""
