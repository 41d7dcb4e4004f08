"""Draws what a seed plays; pure, and the same everywhere.

Each range has random numbers of its own, named by it: another range more, or less, moves no other value. The same seed
draws the same in any campaign with that range, so that two versions can be held against each other game by game.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import combinations
from types import MappingProxyType
from typing import Any, Final, TypeVar

import numpy as np
from pydantic import BaseModel, ValidationError

from app import UserError
from app.campaign.schema import DrawnValue, TaskKind
from app.campaign.spec import CampaignSpec, ChoiceRange, DrawRange, fields, is_whole
from app.campaign.task import CampaignFaults, CampaignStart, CampaignTask, SessionPlan
from app.campaign.tasks.acts import Act
from app.pieces.inventory import Inventory
from app.pieces.layout import start_layout
from app.pieces.position import set_up
from app.play.game_setup import rig_setup_of, start_board
from app.play.player_selection import start_clock
from app.players.given_line import given_line
from app.settings.defaults import PlayerKind, Settings
from app.settings.time_control import TimeControl
from app.settings.toml import sentence_of
from hardware.interfaces import Pace
from hardware.piece_set import Colour
from hardware.sim.process.randomisation import Randomisation
from hardware.table import TableSettings

_M = TypeVar("_M", bound=BaseModel)
_T = TypeVar("_T")

LINGER: Final = 60.0
"""So long a world waits for its program, as on a machine with much to do [s, wall]; where that was killed for good,
whoever comes next ends the world (``scratch``)."""
MOST_PAIRS: Final = 1000
"""So many pairs of values are tried, some seconds of them; what is missed of more ends a campaign with a sentence."""
NOT_USED: Final = MappingProxyType({
    TaskKind.GAME: ("session.",),
    TaskKind.SESSION: ("faults.kills", "faults.knocks", "faults.hands", "start.line", "game.moves"),
    TaskKind.SETUP: (
        "faults.kills", "faults.knocks", "faults.hands", "start.", "session.", "game.plies", "game.moves", "engine.",
        "white.", "black.",
    ),
})  # fmt: skip
"""What a kind has no use for, by name, or by what names begin with."""
_SETTINGS: Final = "settings"
_SECTIONS: Final[dict[str, type[BaseModel]]] = {
    "randomisation": Randomisation, "faults": CampaignFaults, "start": CampaignStart, "session": SessionPlan,
}  # fmt: skip


def draw(spec: CampaignSpec, index: int) -> CampaignTask:
    """The task of a number, from 0.

    Raises:
        ValueError: the values do not go together; a sentence says how.
    """
    seed = spec.first_seed + index
    return _task(spec, index, {name: _value(name, one, seed) for name, one in spec.ranges.items()})


def check_ranges(spec: CampaignSpec) -> None:
    """Find out before anything is played whether everything that ranges allow is possible, as far as that is known.

    Raises:
        ValueError: something is not; a sentence says what.
    """
    for name in spec.draw:
        _require_used(spec.kind, name)
    ends = {name: _ends(name, one) for name, one in spec.ranges.items()}
    first = {name: values[0] for name, values in ends.items()}
    _try(spec, first)
    for name, values in ends.items():
        for value in values[1:]:
            _try(spec, {**first, name: value})
    pairs = [
        {one: a, other: b} for one, other in combinations(ends, 2) for a in ends[one][1:] for b in ends[other][1:]
    ]  # fmt: skip
    for pair in pairs[:: 1 + len(pairs) // MOST_PAIRS]:
        _try(spec, {**first, **pair})
    draw(spec, 0)


def stream(name: str, seed: int) -> np.random.Generator:
    """Random numbers of a name and a seed, independent of those of any other."""
    digest = np.frombuffer(hashlib.sha256(name.encode()).digest()[:16], dtype="<u4")
    return np.random.default_rng([seed, *(int(word) for word in digest)])


def _ends(name: str, one: DrawRange) -> tuple[Any, ...]:
    """As they are in the file; of a list all of its values."""
    if isinstance(one, ChoiceRange):
        return one.one_of
    return tuple(map(int, one.ends)) if is_whole(fields()[name]) else one.ends


def _try(spec: CampaignSpec, drawn: Mapping[str, Any]) -> None:
    settings = _task(spec, 0, drawn).settings
    table = _possible(lambda: rig_setup_of(settings.rig), {"--": "rig."}).table
    _require_position(settings, table)
    for name, time in (
        ("clock.time", settings.clock.time), ("white.time", settings.white.time), ("black.time", settings.black.time),
    ):  # fmt: skip
        if time is not None:
            _possible(partial(TimeControl.parse, time), before=f"{name}: ")
    _possible(lambda: start_clock(settings), {"--clock": "clock.time"})


def _require_position(settings: Settings, table: TableSettings) -> None:
    """Make sure that what is played begins from a position that the set can show, with moves that are legal there."""
    game = settings.game
    board = _possible(lambda: start_board(game.fen, chess960=game.chess960, option="game.fen"))
    _possible(lambda: start_layout(board, table), before="game.fen: ")
    if game.standing is not None:
        fen = game.standing
        standing = _possible(lambda: start_board(fen, option="game.standing"))
        stands = Inventory.of(_possible(lambda: start_layout(standing, table), before="game.standing: "), table)
        if game.fen is not None:
            _possible(lambda: set_up(stands, board), before="game.fen: ")
    if game.moves is not None:
        line = game.moves
        _possible(lambda: given_line(line, board), {"--moves is": "it is"}, "game.moves: ")


def _possible(done: Callable[[], _T], names: Mapping[str, str] = MappingProxyType({}), before: str = "") -> _T:
    """What the product makes of values; what it refuses is said by their names in the file.

    Args:
        done: makes it.
        names: what its sentence calls them, and what they are called here.
        before: what its sentence begins with.

    Raises:
        ValueError: it refuses them.
    """
    try:
        return done()
    except UserError as error:
        said = str(error)
        for option, name in names.items():
            said = said.replace(option, name, 1)
        raise ValueError(before + said) from error


def _value(name: str, one: DrawRange, seed: int) -> Any:
    share = float(stream(f"draw {name}", seed).random())
    if isinstance(one, ChoiceRange):
        return one.one_of[int(share * len(one.one_of))]
    return one.at(share, whole=is_whole(fields()[name]))


def _task(spec: CampaignSpec, index: int, drawn: Mapping[str, Any]) -> CampaignTask:
    seed, values = spec.first_seed + index, {**spec.fixed, **drawn}
    parts: dict[str, dict[str, Any]] = {_SETTINGS: {}, **{name: {} for name in _SECTIONS}}
    for name, value in values.items():
        section, _, rest = name.partition(".")
        if section in _SECTIONS:
            _put(parts[section], rest, value)
        else:
            parts[_SETTINGS][name] = value
    sections: dict[str, Any] = {
        name: _checked(partial(_SECTIONS[name].model_validate, parts[name]), name) for name in _SECTIONS if parts[name]
    }
    task = CampaignTask(
        index=index, seed=seed, kind=spec.kind, settings=Settings(), **sections,
        drawn={name: _column(value) for name, value in drawn.items()},
    )  # fmt: skip
    changes = {**_usual(task, parts[_SETTINGS]), **parts[_SETTINGS]}
    settings = _checked(partial(Settings().with_changes, changes))
    task = task.model_copy(update={"settings": settings})
    _require_sense(task)
    return task


def _put(tree: dict[str, Any], name: str, value: Any) -> None:
    *path, last = name.split(".")
    for part in path:
        tree = tree.setdefault(part, {})
    tree[last] = value


def _column(value: Any) -> DrawnValue:
    return float(value) if isinstance(value, (bool, int, float)) else str(value)


def _usual(task: CampaignTask, given: Mapping[str, Any]) -> dict[str, Any]:
    """What a campaign sets unless its file does: fast, unseen, and with a camera only where something looks."""
    faults, session = task.faults, task.kind is TaskKind.SESSION
    usual: dict[str, Any] = {
        "rig.pace": Pace.FAST, "rig.seed": task.seed, "rig.video": False, "page.on": False,
        "rig.linger": LINGER,
    }  # fmt: skip
    mended = bool(faults.knocks or faults.grip)
    if mended and not session:
        usual["vision.verify"] = True
    if faults.hands:
        usual["vision.guard"] = True
    if (faults.knocks or faults.hands) and not session:
        usual["rig.person"] = Colour.WHITE if task.seed % 2 else Colour.BLACK
    usual["rig.cameras"] = session or any({**usual, **given}.get(f"vision.{one}") for one in ("verify", "guard"))
    if session:
        usual |= {"white.player": PlayerKind.HUMAN, "black.player": PlayerKind.ENGINE}
    if task.kind is TaskKind.SETUP:
        usual["game.plies"] = 0
    return usual


def _require_sense(task: CampaignTask) -> None:
    settings, start = task.settings, task.start
    chosen = start.line or settings.game.moves is not None or task.kind is TaskKind.SETUP
    own = next((name for name in ("fen", "moves") if getattr(settings.game, name) is not None), None)
    begins = [name for name, given in (
        ("start.plies", start.plies), ("start.line", start.line), (f"game.{own}", own),
    ) if given]  # fmt: skip
    if len(begins) > 1:
        raise ValueError(f"{begins[0]} and {begins[1]} exclude each other: leave one of them out")
    if not settings.game.plies and task.kind is not TaskKind.SETUP:
        raise ValueError('game.plies = 0 plays nothing: choose at least 1, or kind = "setup", which has no plies')
    engine, sides = settings.engine, (settings.white, settings.black)
    if not chosen and engine.nodes is None and engine.move_time is None and all(side.elo is None for side in sides):
        raise ValueError(
            "it is not said how long engines think: give engine.nodes, such as 2000, and each game can be repeated; or "
            "engine.move_time, such as 0.1 [s], and none can"
        )
    if task.kind is not TaskKind.SESSION and any(side.player is PlayerKind.HUMAN for side in sides):
        raise ValueError('a person at the board is scripted: say kind = "session", and leave white.player out')


def _require_used(kind: TaskKind, name: str) -> None:
    kinds = [str(one) for one in TaskKind if not name.startswith(NOT_USED[one])]
    if kind not in kinds:
        said = " or ".join(f'"{one}"' for one in kinds)
        raise ValueError(f"{name} is for kind = {said}, not {kind}: leave it out")


def _checked(made: Callable[[], _M], section: str = "") -> _M:
    try:
        return made()
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = _as_written([part for part in (section, *first["loc"]) if part != ""])
        raise ValueError(f"{name}: {sentence_of(first)}") from error


def _as_written(place: Sequence[str | int]) -> str:
    """The dotted name as it is in the file: below a field's there is a key at most, the rest Pydantic adds."""
    acts = {act.value: act.name.lower() for act in Act}
    parts = [acts.get(str(part), str(part)) for part in place]
    known = [length for length in range(1, len(parts) + 1) if ".".join(parts[:length]) in fields()]
    return ".".join(parts[: max(known) + 1] if known else parts)
