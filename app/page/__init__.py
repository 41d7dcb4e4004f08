"""The page: a game watched and played in a browser, and records shown again. docs/page.md has its messages."""
