"""The commands together: what all of them cost."""

from __future__ import annotations

import subprocess
import sys


def test_commands_are_known_without_what_only_one_of_them_needs() -> None:
    """So that ``--help`` answers at once: Pydantic alone takes as long as all the rest."""
    heavy = ("asyncio", "chess", "numpy", "pydantic", "rich")
    script = f"import sys, app.cli.commands; print([name for name in {heavy} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    assert loaded.stdout.strip() == "[]"
