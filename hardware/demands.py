"""What is demanded of a value that was refused, in words for whoever gave it: on a command line, or in a file."""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import Any, Final

from pydantic_core import ErrorDetails

_LIMITS: Final = MappingProxyType({
    "greater_than": ("gt", "more than"), "greater_than_equal": ("ge", "at least"), "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"), "multiple_of": ("multiple_of", "a multiple of"),
})  # fmt: skip
"""By kind of mistake: where Pydantic has the limit, and the words before it."""
_FINITE: Final = "it should be a finite number"
_WHOLE: Final = "it should be a whole number"
_NUMBER: Final = "it should be a number"
_TRUTH: Final = "it should be true or false"
_KINDS: Final = MappingProxyType({
    "finite_number": _FINITE, "int_parsing": _WHOLE, "int_type": _WHOLE, "int_from_float": _WHOLE,
    "int_parsing_size": "it has too many digits", "float_parsing": _NUMBER, "float_type": _NUMBER,
    "bool_parsing": _TRUTH, "bool_type": _TRUTH, "string_type": "it should be a text",
    "path_type": "it should be a path",
})  # fmt: skip
"""What is demanded, by kind of mistake, where no limit is."""


def demand(error: ErrorDetails) -> str:
    """What a value should be, such as "it should be at least 1"."""
    kind, limits = error["type"], error.get("ctx", {})
    if kind in _LIMITS and _is_nan(error["input"]):
        return _FINITE
    if kind in _LIMITS:
        key, words = _LIMITS[kind]
        return f"it should be {words} {_as_written(limits[key])}"
    if kind in ("enum", "literal_error"):
        return f"choose {limits['expected']}".replace("'", "")
    return _KINDS.get(kind) or error["msg"].removeprefix("Value error, ").replace("Input", "it", 1)


def _is_nan(value: Any) -> bool:
    try:
        return math.isnan(float(value))
    except (TypeError, ValueError, OverflowError):
        return False


def _as_written(limit: Any) -> str:
    return f"{limit:g}" if isinstance(limit, float) else str(limit)
