"""Where each piece stands or lies."""
