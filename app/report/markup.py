"""HTML and SVG, safe by construction: whatever is not markup of ours is escaped where it is put in."""

from __future__ import annotations

import html
import unicodedata
from collections.abc import Iterable
from typing import Final

_VOID: Final = frozenset({"meta", "img", "br", "hr", "col"})
_UNSEEN: Final = frozenset({"Cc", "Cs", "Co", "Cn"})
_TURNS: Final = frozenset("\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that turn the direction of what follows: a name could swap the words around it."""


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def escaped(text: str) -> Html:
    """A text as markup; what cannot be shown, and what would turn the text around it, becomes �."""
    shown = "".join(
        "�" if (unicodedata.category(c) in _UNSEEN and c not in "\n\t") or c in _TURNS else c for c in str(text)
    )
    return Html(html.escape(shown, quote=True))


def tag(name: str, /, *children: str, **attributes: object) -> Html:
    """One element.

    Args:
        name: of it.
        children: what is in it; what is no ``Html`` is escaped.
        attributes: None and False leave one out, True has no value; ``class_`` is class, ``_`` within a name is ``-``.
    """
    said = "".join(_attribute(key, value) for key, value in attributes.items() if value is not None)
    if name in _VOID:
        assert not children, f"<{name}> holds nothing"
        return Html(f"<{name}{said}>")
    return Html(f"<{name}{said}>{joined(children)}</{name}>")


def joined(parts: Iterable[str]) -> Html:
    """Markup one after the other; what is no ``Html`` is escaped."""
    return Html("".join(part if isinstance(part, Html) else escaped(part) for part in parts))


def _attribute(key: str, value: object) -> str:
    if value is False:
        return ""
    name = key.rstrip("_").replace("_", "-")
    return f" {name}" if value is True else f' {name}="{escaped(_written(value))}"'


def _written(value: object) -> str:
    """A number of a drawing to a hundredth, without zeros at its end."""
    if isinstance(value, float):
        return f"{value:.2f}".rstrip("0").rstrip(".") or "0"
    return str(value)
