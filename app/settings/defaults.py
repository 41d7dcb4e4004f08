"""What a game is played with: one strict tree of settings, from a TOML file and the command line.

``touchmove config`` prints the tree that is in force, as a TOML file with what every field means. A field that is not
given has its default; a field that does not exist is refused with the nearest one that does.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Final, Literal, Self

import pydantic
from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from app.motion import Profile
from app.settings.time_control import ArmTime
from controller.settings import ANY_PORT, LOOPBACK, IPv4
from engine.settings import BOOK_PLIES, HASH_MB, THREADS, OptionValue
from hardware.frozen import NamedPath
from hardware.interfaces import LINGER, SEED, Pace
from hardware.piece_set import Colour
from hardware.table import Captured

SIMULATED: Final = "sim"
"""Name of the rig that is simulated and started with the program that uses it; also of its bus."""
BOARD: Final = "board"
"""Name of the rig without physics, camera or arm."""


class PadKind(StrEnum):
    """What the fingers of a simulation of our own end in."""

    GROOVED = "grooved"
    """V-grooves, which centre round stems."""
    FLAT = "flat"
    """Flat rubber."""


class PlayerKind(StrEnum):
    """Who chooses the moves of a side."""

    ENGINE = "engine"
    HUMAN = "human"


class Odds(StrEnum):
    """What the stronger side begins without."""

    PAWN = "pawn"
    KNIGHT = "knight"
    BISHOP = "bishop"
    ROOK = "rook"
    QUEEN = "queen"


class LinkRole(StrEnum):
    """Which of two robots that play one game: the other end follows from it."""

    HOST = "host"
    """Says what is played, and waits for the other one."""
    GUEST = "guest"
    """Joins it."""

    @property
    def other(self) -> LinkRole:
        """The other one."""
        return LinkRole.GUEST if self is LinkRole.HOST else LinkRole.HOST


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Processes(StrEnum):
    """Where world and controller of a simulation of our own run in pace fast."""

    TOGETHER = "together"
    """In one process, in one thread: the fastest."""
    SEPARATE = "separate"
    """Each in its own, as with real drives; the same in every bit."""


class Drives(StrEnum):
    """What moves the arm of a simulation of our own."""

    SIM = SIMULATED
    """Drives that are part of the simulation."""
    MOTEUS = "moteus"
    """moteus controllers, emulated to the wire, by their real driver."""
    ETHERCAT = "ethercat"
    """EtherCAT servo drives, likewise."""


class RigSection(_Section):
    """``[rig]``: what the game is played on, and how the arm moves."""

    name: str = SIMULATED
    """sim: a simulation that the program starts; board: no physics, camera or arm; or the TOML file of a lab's rig."""
    pace: Pace | None = None
    """Pace of the simulation: real (the default): by the wall clock; fast: as fast as the machine can. A rig file has
    its own pace."""
    processes: Processes = Processes.TOGETHER
    """In pace fast: together: the simulation's world and controller in one process; separate: each in its own, as in
    pace real. The results are identical to the last bit."""
    drives: Drives = Drives.SIM
    """Drives of the simulated arm: sim: the simulation's own; moteus or ethercat: emulated drives behind their real
    driver, in pace real."""
    profile: Profile | None = None
    """How the arm moves: default, fast, gentle (children in reach), minimum-jerk, or separation (fast while the guard
    sees nobody near, otherwise as default). If left out: separation in a guarded simulation, otherwise default."""
    seed: Annotated[int, Field(ge=0, lt=1 << 63)] = SEED
    """Seed for the opening of two engines and all randomness of a simulation."""
    square: PositiveFloat | None = None
    """Side of a square of the simulated board [mm]; if left out, the default board. Larger boards stand nearer to the
    robot."""
    pads: PadKind = PadKind.GROOVED
    """Finger pads of the simulated robot: grooved or flat."""
    captured: Captured | None = None
    """Where captured pieces go in a simulation: tray (the default): onto places of their own; box: dropped into a box.
    A rig file has its own setting."""
    randomise: NamedPath | None = None
    """TOML file that says how the simulation differs from what the game believes. If left out: slightly, like a careful
    lab (``AS_A_LAB``)."""
    ideal: bool = False
    """The simulation matches exactly what the game believes, except for pieces that people have put down."""
    person: Colour | None = None
    """A simulated person sits at this side, although nobody plays by hand: a separate program moves their hand."""
    linger: NonNegativeFloat = LINGER
    """How long the arm waits for another program if the game's is killed, before it goes onto its brakes [s]."""
    port: Annotated[int, Field(ge=0, le=65535)] = ANY_PORT
    """UDP port of the controller that the program starts; 0: any free one."""
    relay: Annotated[int, Field(ge=1, le=65535)] | None = None
    """UDP port on this computer at which our own controller is reached: of a relay that makes the link worse, as it may
    be in a lab. Left out: the controller's."""
    journal: bool = False
    """The simulation keeps every command, so that its ticks can be repeated."""
    cameras: bool = True
    """Draw the simulation. false needs no OpenGL and is faster, but nothing is seen, filmed or kept as a picture."""
    video: bool = True
    """Film the first part of a game in a simulation."""
    positions: bool = False
    """A simulation keeps where everything was (``positions.bin``), also where nothing is drawn: films and pictures of
    it can be made later."""
    video_length: Annotated[float, Field(ge=1.0)] = 40.0
    """Maximum length of the film, in plant time [s]."""


class GameSection(_Section):
    """``[game]``: where it starts, and how long it lasts."""

    fen: str | None = None
    """Start from this position; if left out, the usual one."""
    chess960: bool = False
    """Castle by the rules of Chess960; needed if king and rooks do not start on their usual squares."""
    standing: str | None = None
    """What stands on the board at the beginning, as FEN: the arm sets up the start position from there. If left out:
    the start position is already there."""
    from_board: bool = False
    """Start from whatever position a person has put on the board: the camera identifies the pieces, and the
    person says whose move it is. In a simulation, ``standing`` or the usual position stands there."""
    moves: str | None = None
    """Play this line (SAN or UCI) instead of asking players."""
    replay: NamedPath | None = None
    """Play the games of this PGN file again, or the game of this folder."""
    replay_game: PositiveInt | None = None
    """Replay only this game, counted from 1."""
    from_ply: PositiveInt = 1
    """Begin the replay with this ply, counted from 1."""
    plies: NonNegativeInt = 300
    """End after this many plies; 0: only set up the start position."""
    games: PositiveInt = 1
    """Number of games; the arm sets up the pieces in between."""


class PracticeSection(_Section):
    """``[practice]``: learning at the board, in games against a person."""

    odds: Odds | None = None
    """The robot begins without a piece: pawn, knight, bishop, rook or queen; where two engines play, White does."""
    coach: bool = False
    """At a person's blunder offer to take it back, and say why."""
    repertoire: NamedPath | None = None
    """PGN file with variations: the robot plays by it, and says where the person has left it."""
    puzzles: NamedPath | None = None
    """Set up the puzzles of this CSV or PGN file one after the other, and play them out."""
    puzzle: PositiveInt = 1
    """Begin with this puzzle of the file, counted from 1."""


class EngineSection(_Section):
    """``[engine]``: the UCI engines that play."""

    path: str | None = None
    """Path of any UCI engine; if left out, Stockfish."""
    move_time: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    """Thinking time per move [s], a day at most; with a clock, the maximum. If left out: 0.2 s without a clock."""
    nodes: Annotated[int, Field(ge=1, lt=1 << 63)] | None = None
    """Search this many nodes instead of thinking for a time: at full strength a run then repeats exactly."""
    threads: PositiveInt = THREADS
    """Threads of the search; with more than one, no run repeats exactly."""
    hash_mb: PositiveInt = HASH_MB
    """Memory of the search [MiB]."""
    ponder: bool | None = None
    """Think while others move. If left out: only in a game with a clock."""
    options: dict[str, OptionValue] = Field(default_factory=dict)
    """Further UCI options by name, as the engine offers them."""
    book: NamedPath | None = None
    """Opening book in Polyglot's format; without one, the seed selects an opening for two engines."""
    book_plies: PositiveInt = BOOK_PLIES
    """Number of plies at the start in which the book is used."""
    syzygy: NamedPath | None = None
    """Folder with Syzygy endgame tables: games of two engines end where the tables know the result, and a person's
    hints come from them."""
    resigns: bool = False
    """Whether the engine resigns a lost game. People like to see a game end on the board."""


class SideSection(_Section):
    """``[white]`` and ``[black]``."""

    player: PlayerKind = PlayerKind.ENGINE
    """engine or human."""
    elo: int | None = None
    """Strength of the engine in Elo, from 400 to the engine's own limit; if left out, full strength."""
    skill: NonNegativeInt | None = None
    """Strength of the engine by its Skill Level (Stockfish: 0 to 20), for play below its lowest Elo."""
    path: str | None = None
    """Path of this side's own engine."""
    book: NamedPath | None = None
    """This side's own opening book."""
    time: str | None = None
    """Time control of this side, if it differs from the clock's."""

    @pydantic.model_validator(mode="after")
    def _one_strength(self) -> Self:
        if self.elo is not None and self.skill is not None:
            raise ValueError("elo and skill both set the strength: leave one of them out")
        return self


class ClockSection(_Section):
    """``[clock]``."""

    time: str | None = None
    """Time control: 5+3 (minutes and seconds per move), 15+10, 0:30+1, 40/90+30,30+30; if left out, no clock."""
    arm_time: ArmTime = ArmTime.NOBODY
    """Whose clock runs during the arm's motion: nobody's, or own: that of the side for which it moves. No flag falls
    because of it in either case."""


class VisionSection(_Section):
    """``[vision]``: what the camera is used for, if there is one."""

    verify: bool | None = None
    """Compare the board with the game after each ply of the arm, and repair errors. If left out: in a lab, and in every
    game against a human."""
    guard: bool | None = None
    """Watch for hands all the time, and hold the arm while one is over the board. If left out: in a lab, and in every
    game against a human."""
    guard_rate: Annotated[float, Field(ge=1.0, le=1000.0)] = 30.0
    """Frame rate of a simulated camera for the guard; a lab's camera has its own rate [1/s]."""
    calibration: NamedPath | None = None
    """File of 'touchmove calibrate' with the poses of camera and board. If left out: the file that a lab's rig file
    names, if any; a simulation is believed to be as specified."""


class OnlineUse(StrEnum):
    """Who plays on Lichess."""

    PERSON = "person"
    """The person at the board plays people, without any help."""
    BOT = "bot"
    """The engine plays whoever challenges it."""


class OnlineSection(_Section):
    """``[online]``: games on Lichess, by 'touchmove online'."""

    use: OnlineUse | None = None
    """person: whoever sits at the board plays people, and no engine runs; bot: the engine plays. If left out: the games
    are not played on Lichess."""
    server: Annotated[str, Field(max_length=200)] = "https://lichess.org"
    """Address of the server: Lichess, or one of your own."""
    token_file: NamedPath | None = None
    """File with the account's token, mode 0600; if left out, the keyring has it. Only the file's name is recorded."""
    opponent: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{2,30}$")] | None = None
    """Challenge this player; if left out, a person is paired with anybody, and a bot waits for challenges."""
    accept: bool = False
    """Wait for a challenge instead of looking for somebody."""
    days: Literal[1, 2, 3, 5, 7, 10, 14] | None = None
    """Days per move of a correspondence game; else the clock's time control holds."""
    color: Colour | None = None
    """Colour to ask for; if left out, either."""
    rated: bool = False
    """Play for rating points."""
    take_backs: bool = True
    """Whether the engine agrees when its opponent wants to take a move back. A person is asked."""
    arm_seconds: Annotated[float, Field(ge=0.0, le=600.0)] | None = None
    """Mean time the arm needs for a ply [s], to tell which time controls it can keep. If left out: 2 s, without an arm
    none."""
    game: Annotated[str, Field(pattern=r"^[A-Za-z0-9]{8}$")] | None = None
    """Go on with this game of the account, by its id, instead of beginning one."""


class Voice(StrEnum):
    """A language that is spoken."""

    ENGLISH = "english"
    GERMAN = "german"


class TerminalSection(_Section):
    """``[terminal]``: what is shown and said there."""

    speak: bool = False
    """Speak moves and requests aloud, with espeak-ng."""
    voice: Voice = Voice.ENGLISH
    """The language it speaks; german: what it has no words for stays English."""
    microphone: bool = False
    """Take moves and requests that are spoken, in English, after 'computer'."""


class PageSection(_Section):
    """``[page]``: what a browser is shown, and who may look."""

    on: bool = True
    """Show games in a browser, where people can also play them."""
    host: IPv4 = LOOPBACK
    """IPv4 address to listen on; any except a loopback address needs a password."""
    port: Annotated[int, Field(ge=0, le=65535)] = 8064
    """TCP port; if another game's page uses it, any free one. 0: any free one."""
    password: NamedPath | None = None
    """File written by 'touchmove page --set-password FILE'; without the password nobody sees anything."""
    address: str | None = None
    """Address that the browser shows if a proxy stands in front of the page, such as https://robot.example."""


class LinkSection(_Section):
    """``[link]``: the other robot, in a game of two robots."""

    role: LinkRole | None = None
    """host or guest; left out: the game is played at this table alone. 'touchmove host' and 'touchmove join' set it."""
    host: str | None = None
    """Name or address of the host's computer, for a guest."""
    listen: IPv4 = LOOPBACK
    """IPv4 address at which a host waits for its guest: 0.0.0.0 for any computer that reaches this one."""
    port: Annotated[int, Field(ge=1, le=65535)] = 8065
    """TCP port of the host."""
    secret: NamedPath | None = None
    """File with the secret of both robots, one line that only its owner can read. If left out: the terminal asks."""
    identity: NamedPath | None = None
    """Folder of this robot's key and certificate, made at first use. If left out: in the user's configuration."""
    color: Colour = Colour.WHITE
    """The host's pieces in the first game."""
    person: bool = False
    """A person plays at this table; otherwise an engine does."""
    name: Annotated[str, Field(max_length=60)] | None = None
    """Who plays here, for the records of both; if left out, as in other games."""


class Settings(_Section):
    """Everything."""

    rig: RigSection = RigSection()
    game: GameSection = GameSection()
    practice: PracticeSection = PracticeSection()
    engine: EngineSection = EngineSection()
    white: SideSection = SideSection()
    black: SideSection = SideSection()
    clock: ClockSection = ClockSection()
    vision: VisionSection = VisionSection()
    online: OnlineSection = OnlineSection()
    terminal: TerminalSection = TerminalSection()
    page: PageSection = PageSection()
    link: LinkSection = LinkSection()
    out: NamedPath | None = None
    """Folder of the record; if left out, games/<time>."""

    @property
    def two_people(self) -> bool:
        """Whether both sides are played by hand."""
        return self.white.player is PlayerKind.HUMAN and self.black.player is PlayerKind.HUMAN

    def side(self, white: bool) -> SideSection:
        """Of a colour, as python-chess has it (True is white)."""
        return self.white if white else self.black

    def with_changes(self, changes: Mapping[str, Any]) -> Settings:
        """With other values by dotted name, such as ``rig.pace``; None: as it is. Raises ``ValidationError``."""
        tree = self.model_dump()
        for name, value in changes.items():
            if value is None:
                continue
            *path, last = name.split(".")
            branch = tree
            for part in path:
                branch = branch[part]
            branch[last] = value
        return Settings.model_validate(tree)
