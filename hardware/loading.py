"""What lets programs load sooner: nothing that nobody uses is loaded, and nobody looks for garbage meanwhile."""

import gc
import sys
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from types import ModuleType

_BLAS = "scipy.linalg.cython_blas"


def spare_blas() -> None:
    """Spare a start the tenth of a second in which Numba loads SciPy's linear algebra to see whether BLAS is there.

    Before anything is compiled: then Numba looks. Compiled code of ours solves what it has to solve in closed form;
    `np.dot` and `np.linalg` in it would say that they need SciPy.
    """
    if _BLAS in sys.modules:
        return
    sys.modules[_BLAS] = cast("ModuleType", None)  # Python's way to say: not to be imported
    try:
        import numba.np.arraymath  # noqa: F401, PLC0415 - this is where it looks
    finally:
        del sys.modules[_BLAS]


def begin_loading() -> None:
    """What runs is loaded from here on: nothing of that is garbage, and to look for it takes a tenth of the time."""
    gc.disable()


def end_loading() -> None:
    """All is there: garbage is looked for again, not among what was loaded. Where nothing was begun nothing is done."""
    if not gc.isenabled():
        gc.freeze()
        gc.enable()
