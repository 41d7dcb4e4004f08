"""A typed door to Numba, and a cache on disk that notices a change in any module of the controller that compiles.

Numba's own cache looks only at the file a function stands in. A function that calls into another file would go on
with the old code of that file after an edit, silently. So the cache directory carries a digest of the sources of all
folders that compiled code stands in. Rule that follows: compiled code calls only functions of its own file and of them.
"""

import hashlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

import numba
import numpy as np
from numba.extending import intrinsic
from numpy.typing import NDArray

from hardware.loading import spare_blas

P = ParamSpec("P")
R = TypeVar("R")

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Vector = tuple[float, float, float]

# Numba's own types are incomplete; behind this line everything is typed.
_numba: Any = numba
carray: Any = _numba.carray


spare_blas()

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
WHOLE: Any = _numba.types.Array(STATUS, 1, "C")
WHOLES: Any = _numba.types.Array(STATUS, 2, "C")
DEMAND: Any = _numba.types.Tuple((STATUS, STATUS, TABLE, TABLE))

_PACKAGE = Path(__file__).resolve().parent
_FOLDERS = ("law", "loop", "model", "protection")
"""Of the controller, whose compiled functions call each other."""


def _cache_directory() -> Path | None:
    """Where the compiled code of exactly these sources is kept; None where nothing can be kept.

    Made here: Numba would quietly take another place for one that it cannot write to, and that has no digest.
    """
    digest = hashlib.sha256()
    for room in _FOLDERS:
        for source in sorted((_PACKAGE.parent / room).glob("*.py")):
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
        "touchmove: compiled code cannot be cached, so every start compiles again (about 10 s): set NUMBA_CACHE_DIR "
        "to a writable folder",
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


def _pointer_to(kind: Any) -> Any:
    """Makes of a number, in compiled code, a pointer to numbers of a kind."""

    @intrinsic
    def pointed(_typing: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return _numba.types.CPointer(kind)(address), generate

    return pointed


_floats_at, _wholes_at = _pointer_to(SCALAR), _pointer_to(STATUS)


@compiled
def row_at(address: int, size: int) -> FloatArray:
    """An array of so many floats that lies there."""
    found: FloatArray = carray(_floats_at(address), (size,))
    return found


@compiled
def table_at(address: int, rows: int, columns: int) -> FloatArray:
    """An array of rows of floats that lies there."""
    found: FloatArray = carray(_floats_at(address), (rows, columns))
    return found


@compiled
def wholes_at(address: int, rows: int, columns: int) -> IntArray:
    """An array of rows of whole numbers that lies there."""
    found: IntArray = carray(_wholes_at(address), (rows, columns))
    return found


def callback(function: Callable[[int, int, int], int]) -> int:
    """Address of a C function of three addresses that does what a function of three numbers does; 0 where nothing is
    compiled, as for the coverage of its lines.
    """
    if _numba.config.DISABLE_JIT:
        return 0
    before = _numba.config.CACHE_DIR
    _numba.config.CACHE_DIR = str(_CACHE or "")
    try:
        made = _numba.cfunc(STATUS(STATUS, STATUS, STATUS), cache=_CACHE is not None, error_model="numpy")(function)
    finally:
        _numba.config.CACHE_DIR = before
    _KEPT.append(made)
    return int(made.address)


_KEPT: list[Any] = []
"""Compiled callbacks live as long as the process, as their addresses may be anywhere."""
