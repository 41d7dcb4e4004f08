"""A typed door to Numba, and a cache on disk that notices a change in any module of the model.

Numba's own cache looks only at the file a function stands in. A function that calls into another file would go on
with the old code of that file after an edit, silently. So the cache directory carries a digest of this package's
sources. Rule that follows: compiled code calls only functions of its own file and of this package.
"""

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numpy.typing import NDArray

P = ParamSpec("P")
R = TypeVar("R")

FloatArray = NDArray[np.float64]
Vector = tuple[float, float, float]

# Numba's own types are incomplete; behind this line everything is typed.
_numba: Any = numba


def _skip_blas() -> None:
    """Spare a start the 0.3 s in which Numba loads SciPy's linear algebra to see whether BLAS is there.

    Compiled code here solves what it has to solve in closed form. `np.dot` and `np.linalg` in compiled code would say
    that they need SciPy.
    """
    name = "scipy.linalg.cython_blas"
    if name in sys.modules:
        return
    sys.modules[name] = cast("ModuleType", None)  # Python's way to say: not to be imported
    try:
        import numba.np.arraymath  # noqa: F401, PLC0415 - this is where it looks
    finally:
        del sys.modules[name]


_skip_blas()

SCALAR: Any = _numba.types.float64
STATUS: Any = _numba.types.int64
PAIR: Any = _numba.types.UniTuple(SCALAR, 2)
VECTOR: Any = _numba.types.UniTuple(SCALAR, 3)
PLACED: Any = _numba.types.UniTuple(VECTOR, 2)
TRUTH: Any = _numba.types.boolean
FINDING: Any = _numba.types.Tuple((STATUS, STATUS, STATUS, SCALAR))
FROZEN: Any = _numba.types.Array(SCALAR, 1, "C", readonly=True)
ROW: Any = _numba.types.Array(SCALAR, 1, "C")
TABLE: Any = _numba.types.Array(SCALAR, 2, "C")
DEMAND: Any = _numba.types.Tuple((STATUS, STATUS, TABLE, TABLE))

_PACKAGE = Path(__file__).resolve().parent


def _cache_directory() -> Path | None:
    """Where the compiled code of exactly these sources is kept; None where nothing can be kept.

    Made here: Numba would quietly take another place for one that it cannot write to, and that has no digest.
    """
    digest = hashlib.sha256()
    for source in sorted(_PACKAGE.glob("*.py")):
        digest.update(source.read_bytes())
    asked = _numba.config.CACHE_DIR
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "touchmove"
    for root in (Path(asked),) if asked else (_PACKAGE / "__pycache__", user):
        folder = root / f"compiled-{digest.hexdigest()[:16]}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    return None


_CACHE = _cache_directory()
if _CACHE is None:
    print(
        "touchmove: compiled code cannot be kept, so every start compiles anew (about 10 s): set NUMBA_CACHE_DIR to a "
        "folder that can be written",
        file=sys.stderr,
    )


def compiled(function: Callable[P, R], signature: object = None) -> Callable[P, R]:
    """Compile a function with Numba, under the same type: exact floating point, NumPy's error model, cached on disk.

    It is one of floats, tuples of floats and float64 arrays. With a signature it is compiled at once, else by the first
    call.
    """
    before = _numba.config.CACHE_DIR
    _numba.config.CACHE_DIR = str(_CACHE or "")
    try:
        decorate = _numba.njit(signature, cache=_CACHE is not None, fastmath=False, error_model="numpy")
        return cast("Callable[P, R]", decorate(function))
    finally:
        _numba.config.CACHE_DIR = before


def direct(function: Callable[P, R]) -> Callable[P, R]:
    """What a function of `compiled_as` compiles to, without Numba's dispatcher in front: half the price of a call.

    The dispatcher looks at the type of each argument to choose among compiled versions. Here there is one, and it
    takes what it is given for what its signature says: an array must be of float64 and of the signature's layout,
    which is the caller's to see to. Numbers and tuples are converted and checked as before.
    """
    dispatcher: Any = function
    if _numba.config.DISABLE_JIT:  # nothing is compiled, as for the coverage of its lines
        return function
    (version,) = dispatcher.overloads.values()
    return cast("Callable[P, R]", version.entry_point)


def compiled_as(signature: object) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator: compile for one signature when the module is imported, so that no later call ever compiles."""
    return lambda function: compiled(function, signature)
