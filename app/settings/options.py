"""Which option of the command line sets which field of the settings, and where it has an effect.

The one table of it: the command line reads it, sentences about a field name its option by it, and an option that
would change nothing is refused by it instead of being taken in silence.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from pydantic import BaseModel

from app.settings.defaults import SIMULATED, OnlineUse, Settings


@dataclass(frozen=True, slots=True)
class Need:
    """What has to be so for an option to have an effect: the same for people, and whether it is so."""

    said: str
    met: Callable[[Settings], bool]


def _thinks(settings: Settings) -> bool:
    game = settings.game
    given = game.moves is not None or game.replay is not None or settings.practice.puzzles is not None
    return not given and game.plies > 0


_OWN: Final = Need("a simulation that this program starts (--rig sim)", lambda settings: settings.rig.name == SIMULATED)
_DRAWN: Final = Need("a simulation that is drawn (without --no-cameras)", lambda settings: settings.rig.cameras)
_DRAWN_BY_SEED: Final = Need(
    "a world without given differences (without --randomise)", lambda settings: settings.rig.randomise is None
)
_FILMED: Final = Need("a film (without --no-video)", lambda settings: settings.rig.video)
_ENGINES: Final = Need("engines that choose the moves (without --moves)", _thinks)
_BY_TIME: Final = Need("engines that think by time (without --nodes)", lambda settings: settings.engine.nodes is None)
_SHOWN: Final = Need("games that are shown in a browser (without --no-page)", lambda settings: settings.page.on)
_GIVEN: Final = Need("a position that is given (without --from-board)", lambda settings: not settings.game.from_board)
_USUAL: Final = Need(
    "games from the usual start (without --fen or --from-board)",
    lambda settings: settings.game.fen is None and not settings.game.from_board,
)
_STANDS: Final = Need(
    "a position that is set up, or that a simulation begins from (with --from-board)",
    lambda settings: settings.game.plies == 0 or (settings.game.from_board and settings.rig.name == SIMULATED),
)
_BOT: Final = Need("an engine that plays (--bot)", lambda settings: settings.online.use is OnlineUse.BOT)
_NO_WAITING: Final = Need("challenging somebody (without --accept)", lambda settings: not settings.online.accept)


@dataclass(frozen=True, slots=True)
class SettingOption:
    """An option.

    Attributes:
        field: of the settings, by dotted name.
        flag: as it is written on the command line; of an argument, its name.
        needs: what has to be so for it to have an effect.
    """

    field: str
    flag: str
    needs: tuple[Need, ...] = ()

    @property
    def parameter(self) -> str:
        """The parameter of a command's function that it is given to."""
        return self.flag.removeprefix("--").replace("-", "_").lower()


_ALL: Final = (
    SettingOption("rig.name", "--rig"),
    SettingOption("rig.pace", "--pace"),
    SettingOption("rig.processes", "--processes"),
    SettingOption("rig.drives", "--drives", (_OWN,)),
    SettingOption("rig.profile", "--profile"),
    SettingOption("rig.seed", "--seed"),
    SettingOption("rig.square", "--square", (_OWN,)),
    SettingOption("rig.pads", "--pads", (_OWN,)),
    SettingOption("rig.captured", "--captured"),
    SettingOption("rig.randomise", "--randomise", (_OWN,)),
    SettingOption("rig.ideal", "--ideal", (_OWN, _DRAWN_BY_SEED)),
    SettingOption("rig.linger", "--linger", (_OWN,)),
    SettingOption("rig.port", "--port", (_OWN,)),
    SettingOption("rig.cameras", "--cameras", (_OWN,)),
    SettingOption("rig.video", "--video", (_OWN, _DRAWN)),
    SettingOption("rig.video_length", "--video-length", (_OWN, _DRAWN, _FILMED)),
    SettingOption("game.fen", "--fen", (_GIVEN,)),
    SettingOption("game.chess960", "--chess960"),
    SettingOption("game.from_board", "--from-board"),
    SettingOption("game.standing", "--standing", (_STANDS,)),
    SettingOption("game.moves", "--moves"),
    SettingOption("game.plies", "--plies"),
    SettingOption("game.games", "--games"),
    SettingOption("game.replay", "FILE"),
    SettingOption("game.replay_game", "--game"),
    SettingOption("game.from_ply", "--from-ply"),
    SettingOption("practice.odds", "--odds", (_USUAL,)),
    SettingOption("practice.coach", "--coach"),
    SettingOption("practice.repertoire", "--repertoire", (_ENGINES,)),
    SettingOption("practice.puzzles", "PUZZLES"),
    SettingOption("practice.puzzle", "--number"),
    SettingOption("engine.path", "--engine", (_ENGINES,)),
    SettingOption("engine.move_time", "--movetime", (_ENGINES, _BY_TIME)),
    SettingOption("engine.nodes", "--nodes", (_ENGINES,)),
    SettingOption("engine.book", "--book", (_ENGINES,)),
    SettingOption("engine.syzygy", "--syzygy", (_ENGINES,)),
    *(
        SettingOption(f"{side}.{field}", f"--{side}-{name}", (_ENGINES,))
        for side in ("white", "black")
        for field, name in (("path", "engine"), ("elo", "elo"), ("book", "book"), ("time", "clock"))
    ),
    SettingOption("clock.time", "--clock", (_ENGINES,)),
    SettingOption("vision.verify", "--verify"),
    SettingOption("vision.guard", "--guard"),
    SettingOption("online.server", "--server"),
    SettingOption("online.token_file", "--token-file"),
    SettingOption("online.opponent", "--opponent", (_NO_WAITING,)),
    SettingOption("online.accept", "--accept"),
    SettingOption("online.days", "--days"),
    SettingOption("online.rated", "--rated"),
    SettingOption("online.take_backs", "--take-backs", (_BOT,)),
    SettingOption("online.arm_seconds", "--arm-seconds"),
    SettingOption("online.game", "--game-id"),
    SettingOption("terminal.speak", "--speak"),
    SettingOption("terminal.voice", "--voice"),
    SettingOption("terminal.microphone", "--microphone"),
    SettingOption("page.on", "--page"),
    SettingOption("page.port", "--page-port", (_SHOWN,)),
    SettingOption("out", "--out"),
)
OPTIONS: Final = MappingProxyType({option.field: option for option in _ALL})
"""By dotted name of the field."""


def option_of(field: str) -> str:
    """How a field is named to people who did not write a file: by its option, else by its name in the file."""
    return OPTIONS[field].flag if field in OPTIONS else field


def without_effect(settings: Settings, fields: Iterable[str]) -> list[str]:
    """A sentence on each of these fields that changes nothing in a game with these settings.

    Leaving off what is not there anyhow, as in ``--no-video`` without a camera, is no fault.
    """
    return [
        f"{OPTIONS[field].flag} has no effect here, it is for {need.said}: leave it out"
        for field in fields
        if field in OPTIONS and _value(settings, field) is not False
        for need in [next((need for need in OPTIONS[field].needs if not need.met(settings)), None)]
        if need is not None
    ]


def changed_fields(settings: Settings) -> list[str]:
    """The fields with an option that have another value than their default."""
    default = Settings()
    return [field for field in OPTIONS if _value(settings, field) != _value(default, field)]


def _value(settings: BaseModel, field: str) -> Any:
    value: Any = settings
    for part in field.split("."):
        value = getattr(value, part)
    return value
