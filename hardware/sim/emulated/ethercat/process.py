"""The process of a simulated world behind emulated EtherCAT drives: ``python -P -m … RUN_DIR``.

It makes the network first, while it has one thread alone, and only then loads everything else. The cable's other end
stays for as long as this process lives.
"""

import signal
import sys
from pathlib import Path

from hardware.sim.emulated.ethercat.namespace import NoNetwork, announce, make_network


def main(run_dir: Path) -> int:
    """Be the world and its devices until nobody needs them; exit status, after one sentence where it is not 0."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # while it starts; a world that runs has its own way
    try:
        make_network()
        announce(run_dir)
    except NoNetwork as error:
        return _sorry(error)
    from hardware.interfaces import HardwareError  # noqa: PLC0415 - after the network was made
    from hardware.sim.emulated.process import run_emulated  # noqa: PLC0415

    try:
        run_emulated(run_dir)
    except HardwareError as error:
        return _sorry(error)
    return 0


def _sorry(error: Exception) -> int:
    print(error, file=sys.stderr, flush=True)
    return 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
