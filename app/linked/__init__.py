"""Two robots play one game: each carries out both sides on its own table, and a link keeps their records the same.

docs/two-robots.md describes the link. From the bottom up: ``identity`` and ``secret`` (who they are), ``messages``,
``sealing`` (numbered and authenticated lines), ``log`` (what both agree on), ``opponent`` (the game loop's side of it),
``connection`` (TLS, one thread), ``link`` (all of it together).
"""
