"""How many threads a worker's libraries may start: as many games as cores are played at a time, and each has one."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

_NAMES: Final = (
    "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENCV_FOR_THREADS_NUM",
)  # fmt: skip
ONE_THREAD: Final = MappingProxyType({**dict.fromkeys(_NAMES, "1"), "LP_NUM_THREADS": "0"})
"""Environment variables of a worker; Mesa counts threads beside the one that draws."""
SUMS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Those by which sums are taken in another order, and come out otherwise in their last bits."""
