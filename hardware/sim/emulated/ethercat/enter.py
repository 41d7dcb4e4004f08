"""Runs a module of ours in the user namespace of an emulated segment: ``python -P -m … RUN_DIR MODULE ARGUMENT …``.

That is where its sockets may be opened in the segment's network, see ``namespace``; the process stays in the network in
which it was started, so that everybody else finds it where they are used to.
"""

import runpy
import sys
import time
from pathlib import Path
from typing import Final

from hardware.sim.emulated.ethercat.namespace import NoNetwork, join_user_namespace

NETWORK_FILE: Final = "network.pid"
"""In the run directory: the process whose network the cable is in."""
PATIENCE: Final = 60.0
"""Within which the emulator has made its network [s]."""


def network_pid(run_dir: Path, patience: float = PATIENCE) -> int:
    """The process whose network the cable is in, waited for [s]; raises ``NoNetwork``."""
    deadline = time.monotonic() + patience
    while not (run_dir / NETWORK_FILE).exists():
        if time.monotonic() > deadline:
            raise NoNetwork(
                f"no emulated EtherCAT devices were started in {run_dir} within {patience:.0f} s: see its logs"
            )
        time.sleep(0.005)
    return int((run_dir / NETWORK_FILE).read_text(encoding="ascii"))


def main() -> None:
    """Enter, and become the module."""
    run_dir, module, *arguments = sys.argv[1:]
    try:
        join_user_namespace(network_pid(Path(run_dir)))
    except NoNetwork as error:
        sys.exit(str(error))
    sys.argv = [module, *arguments]
    runpy.run_module(module, run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    main()
