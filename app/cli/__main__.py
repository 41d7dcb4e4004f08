"""``python -m app.cli``: for our own processes, which must not depend on where the command lies."""

from app.cli import main

main()
