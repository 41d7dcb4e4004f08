"""Run a module where the emulated EtherCAT devices are: ``python -P -m … PID -m MODULE ARGUMENTS …``.

PID is the process of their world, or its run directory, in which it is waited for. Whoever is not root has no right to
its network until this process, while it has one thread alone, has entered that process's user namespace; so it does
that before the module, and numpy with it, is loaded. The module's own network stays as it is: see
``namespace.within_network``. Of a world that root has started there is nothing to enter, and the module runs as ever.
"""

import runpy
import sys
from collections.abc import Sequence
from pathlib import Path

from hardware.sim.emulated.ethercat.namespace import NoNetwork, join_user_namespace, network_pid

USAGE = "usage: python -P -m hardware.sim.emulated.ethercat.enter_namespace PID|RUN_DIR -m MODULE [ARGUMENTS ...]"


def main(arguments: Sequence[str]) -> None:
    """Enter, then be the module; raises ``SystemExit`` with a sentence if it cannot be entered."""
    match arguments:
        case [where, "-m", module, *rest]:
            try:
                join_user_namespace(int(where) if where.isdecimal() else network_pid(Path(where)))
            except NoNetwork as error:
                sys.exit(str(error))
            sys.argv = [module, *rest]
            runpy.run_module(module, run_name="__main__", alter_sys=True)
        case _:
            sys.exit(USAGE)


if __name__ == "__main__":
    main(sys.argv[1:])
