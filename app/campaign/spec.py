"""A campaign's file: what is played, from which seed on, and over which ranges. Strict TOML.

Values stand below ``[draw]`` by dotted names: any field of the settings (``engine.nodes``), of the world's
randomisation (``randomisation.piece_mass``), of ``CampaignFaults`` (``faults.grip``), ``CampaignStart`` and
``SessionPlan``. Each is a plain value or a range.
"""

from __future__ import annotations

import difflib
import math
import types
import typing
from collections.abc import Iterator, Mapping
from functools import cache
from types import MappingProxyType
from typing import Any, Final, Self

from pydantic import BaseModel, Field, NonNegativeInt, ValidationError, model_validator

from app.campaign.schema import TaskKind
from app.campaign.task import CampaignFaults, CampaignStart, SessionPlan
from app.settings.defaults import Settings
from app.settings.toml import sentence_of
from hardware.frozen import FrozenFinite
from hardware.sim.process.randomisation import Randomisation

Plain = bool | int | float | str
LAST_SEED: Final = 2**53
"""Beyond it a table's numbers take several seeds for one."""
_NO_REPLAY: Final = "no campaign replays or asks a person; say game.moves or game.standing"
RESERVED: Final = MappingProxyType({
    "out": "say --out on the command line", "game.games": "say --games on the command line",
    "rig.name": "it is always a simulation; leave it out", "rig.seed": "say first_seed",
    "rig.pace": "it is always fast; leave it out", "rig.drives": "they are always sim; leave it out",
    "rig.randomise": "say what the file holds as randomisation.*", "rig.ideal": "say randomisation.*",
    "rig.port": "each game takes a free one; leave it out", "rig.relay": "say faults.link_loss",
    "game.replay": _NO_REPLAY, "game.replay_game": _NO_REPLAY, "game.from_ply": _NO_REPLAY,
    "game.from_board": _NO_REPLAY,
    "page": "nobody looks on; leave it out", "terminal": "nobody listens; leave it out",
    "online": "nothing is played on Lichess; leave it out", "link": "one robot plays alone; leave it out",
    "practice": "nobody learns; leave it out",
})  # fmt: skip
"""Settings that a campaign decides itself, or that mean nothing in one, and whole sections of these: what to do."""
_RANGES: Final = ({"from", "to"}, {"from", "to", "log"}, {"one_of"})
_RANGE_KEYS: Final = "a range has from and to, and perhaps log; or one_of alone"


class UniformRange(FrozenFinite):
    """Any value between two, each as likely; of fields for whole numbers a whole one, both ends included."""

    from_: float = Field(alias="from")
    to: float
    log: bool = False
    """By its logarithm: from 1 to 100 half of them are below 10."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.to < self.from_:
            raise ValueError(f"to = {self.to:g} is below from = {self.from_:g}: exchange them")
        if self.log and self.from_ <= 0.0:
            raise ValueError(f"from = {self.from_:g} has no logarithm: choose one above 0, or leave log out")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """Both."""
        return self.from_, self.to

    def at(self, share: float, *, whole: bool) -> float | int:
        """The value below which this share of all lies, 0 to 1."""
        low, high = self.from_ - 0.5 * whole, self.to + 0.5 * whole
        if self.log:  # a whole number's lower end stays above 0: none is below 1
            low, high = math.log(low), math.log(high)
        value = low + share * (high - low)
        value = math.exp(value) if self.log else value
        return min(max(round(value), round(self.from_)), round(self.to)) if whole else value


class ChoiceRange(FrozenFinite):
    """One of some values, each as likely; one that is named twice is twice as likely."""

    one_of: tuple[Plain, ...] = Field(min_length=1)


DrawRange = UniformRange | ChoiceRange


class CampaignSpec(FrozenFinite):
    """A campaign but for how many games it has."""

    kind: TaskKind = TaskKind.GAME
    """game, session or setup."""
    first_seed: NonNegativeInt = 1
    """Of the first task; each other one has the next."""
    title: str = ""
    """For people."""
    draw: dict[str, Any] = Field(default_factory=dict)
    """Ranges and plain values by dotted name."""

    @model_validator(mode="before")
    @classmethod
    def _flat(cls, given: Any) -> Any:
        if isinstance(given, Mapping) and isinstance(given.get("draw"), Mapping):
            return {**given, "draw": dict(_flattened(given["draw"]))}
        return given

    @model_validator(mode="after")
    def _known(self) -> Self:
        for name, value in self.draw.items():
            _require_known(name)
            kind = fields()[name]
            if isinstance(value, UniformRange):
                _require_numbers(name, kind, value)
            elif isinstance(value, Mapping) and typing.get_origin(kind) is not dict:
                raise ValueError(f"{name}: {_RANGE_KEYS}; there is {', '.join(map(str, value)) or 'nothing'}")
        return self

    @property
    def ranges(self) -> dict[str, DrawRange]:
        """What differs from seed to seed, by name."""
        return {name: value for name, value in self.draw.items() if isinstance(value, DrawRange)}

    @property
    def fixed(self) -> dict[str, Any]:
        """What does not."""
        return {name: value for name, value in self.draw.items() if not isinstance(value, DrawRange)}


@cache
def fields() -> Mapping[str, Any]:
    """Everything that can be drawn: the type of each by its dotted name."""
    return MappingProxyType({
        **{name: kind for name, kind in _fields(Settings, "") if not _reserved(name)},
        **dict(_fields(Randomisation, "randomisation.")),
        **dict(_fields(CampaignFaults, "faults.")),
        **dict(_fields(CampaignStart, "start.")),
        **dict(_fields(SessionPlan, "session.")),
    })  # fmt: skip


def is_whole(kind: Any) -> bool:
    """Whether a field of this type is for whole numbers."""
    parts = set(parts_of(kind))
    return int in parts and float not in parts


def _reserved(name: str) -> str | None:
    """By which name a campaign keeps it for itself."""
    return next((one for one in (name, name.split(".", maxsplit=1)[0]) if one in RESERVED), None)


def _require_known(name: str) -> None:
    names = fields()
    if name in names:
        return
    if (kept := _reserved(name)) is not None:
        raise ValueError(f"{name} is the campaign's own: {RESERVED[kept]}")
    near = difflib.get_close_matches(name, names, n=1)
    said = f"did you mean {near[0]}?" if near else "'touchmove config' and docs/campaign.md list them"
    raise ValueError(f"there is nothing called {name} to draw: {said}")


def _require_numbers(name: str, kind: Any, given: UniformRange) -> None:
    parts = set(parts_of(kind))
    if bool in parts:
        raise ValueError(f"{name} is true or false, and has no from and to: use one_of = [true, false]")
    if not parts & {int, float}:
        raise ValueError(f"{name} is no number, and has no from and to: use one_of with a list of values")
    if is_whole(kind) and not all(end.is_integer() for end in given.ends):
        raise ValueError(
            f"{name} is a whole number: write from = {given.from_:g} and to = {given.to:g} without fractions"
        )


def _fields(model: type[BaseModel], before: str) -> Iterator[tuple[str, Any]]:
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            yield from _fields(kind, f"{before}{name}.")
        else:
            yield before + name, kind


def parts_of(kind: Any) -> Iterator[Any]:
    """The types that a field's may be one of."""
    if typing.get_origin(kind) in (typing.Union, types.UnionType, typing.Annotated):
        for part in typing.get_args(kind):
            yield from parts_of(part)
    else:
        yield kind


def _flattened(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Tables within tables as dotted names; a table with the keys of a range is one."""
    known = fields()
    for key, value in table.items():
        name = before + key
        if isinstance(value, Mapping) and set(value) in _RANGES:
            yield name, _range(name, value)
        elif isinstance(value, Mapping) and name not in known and not {"from", "to", "one_of"} & set(value):
            yield from _flattened(value, f"{name}.")
        else:
            yield name, value


def _range(name: str, given: Mapping[str, Any]) -> DrawRange:
    if given.get("one_of") == []:
        raise ValueError(f"{name}: one_of is empty: name at least one value")
    try:
        return (ChoiceRange if "one_of" in given else UniformRange).model_validate(given)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        raise ValueError(": ".join((name, *map(str, first["loc"][:1]), sentence_of(first)))) from error
