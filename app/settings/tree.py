"""What a game is played with: one strict tree of settings, from a TOML file and the command line.

``touchmove config`` prints the tree that is in force, as a TOML file with what every field means. A field that is not
given has its default; a field that does not exist is refused with the nearest one that does.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final

from pydantic import BaseModel, ConfigDict, Field, NonNegativeFloat, NonNegativeInt, PositiveFloat, PositiveInt

from app.motion import Profile
from app.settings.time_control import ArmTime
from controller.settings import ANY_PORT, LOOPBACK, IPv4
from engine.settings import HASH_MB, THREADS, OptionValue
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


class _Section(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, use_attribute_docstrings=True)


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
    """sim, a simulation of our own; board, without physics, camera or arm; or the TOML file of a lab's rig."""
    pace: Pace | None = None
    """Of a simulation of our own: real (the default), by the wall clock; fast, as fast as the machine can. A rig file
    says its own."""
    processes: Processes = Processes.TOGETHER
    """Of a simulation of our own in pace fast: together, world and controller in one process; separate, each in its
    own, as in pace real. Both come to the same in every bit."""
    drives: Drives = Drives.SIM
    """What moves the arm of a simulation of our own: sim, drives of its own; moteus or ethercat, emulated drives by
    their real driver, in pace real."""
    profile: Profile | None = None
    """How the arm moves: default, fast, gentle (children in reach), minimum-jerk, or separation: fast where the guard
    sees nobody near, else as default. Left out: separation in a simulation of our own that is guarded, else default."""
    seed: Annotated[int, Field(ge=0, lt=1 << 63)] = SEED
    """Chooses the opening of two engines, and all randomness of a simulation."""
    square: PositiveFloat | None = None
    """Side of a square of a simulation of our own [mm]; the default board if left out. A larger board stands nearer to
    the robot."""
    pads: PadKind = PadKind.GROOVED
    """What the fingers of a simulation of our own end in: grooved, or flat."""
    captured: Captured | None = None
    """Where captured pieces go on the table of a simulation of our own: tray (the default), to places of their own;
    box, dropped. A rig file says its own."""
    randomise: Path | None = None
    """TOML file that says how a simulation of our own differs from what the game believes of it. Left out: mildly, as a
    careful lab would (``AS_A_LAB``) …"""
    ideal: bool = False
    """… or, if so, not at all, but for pieces that stand where people put them."""
    person: Colour | None = None
    """A simulated person sits at this side of a simulation of our own, though nobody plays by hand: their hand does
    what a program of its own has it do."""
    linger: NonNegativeFloat = LINGER
    """If the game's program is killed: how long the arm waits for another one, before it is put on its brakes [s]."""
    port: Annotated[int, Field(ge=0, le=65535)] = ANY_PORT
    """UDP port of our own controller; 0: any that is free."""
    relay: Annotated[int, Field(ge=1, le=65535)] | None = None
    """UDP port on this computer at which our own controller is reached: of a relay that makes the link worse, as it may
    be in a lab. Left out: the controller's."""
    journal: bool = False
    """A simulation of our own keeps every command, so that its ticks can be done again."""
    cameras: bool = True
    """A simulation of our own is drawn. False: it needs no OpenGL and is faster, but nothing is seen, filmed or kept as
    a picture."""
    video: bool = True
    """Film the first part of a game in a simulation."""
    positions: bool = False
    """A simulation keeps where everything was (``positions.bin``), also where nothing is drawn: films and pictures of
    it can be made later."""
    video_length: Annotated[float, Field(ge=1.0)] = 40.0
    """Longest film, in plant time [s]."""


class GameSection(_Section):
    """``[game]``: where it starts, and how long it goes on."""

    fen: str | None = None
    """Start from this position; the usual one if left out."""
    chess960: bool = False
    """Castling by the rules of Chess960; needed where the start position castles from other squares than usual."""
    standing: str | None = None
    """What stands on the board at the beginning, as FEN: the arm sets up the start position from there. Left out: the
    start position stands there already."""
    from_board: bool = False
    """Start from whatever position a person has put on the board: the camera tells the pieces, and the person whose
    move it is. In a simulation ``standing`` stands there, else the usual position."""
    moves: str | None = None
    """Play this line (SAN or UCI) instead of asking players."""
    replay: Path | None = None
    """Play the games of this PGN file again, or that of this folder."""
    replay_game: PositiveInt | None = None
    """Of those only this one, from 1."""
    from_ply: PositiveInt = 1
    """Of those only from this ply on, from 1."""
    plies: NonNegativeInt = 300
    """End after so many plies; 0: only set the start position up."""
    games: PositiveInt = 1
    """So many games one after the other; the arm sets the pieces up in between."""


class EngineSection(_Section):
    """``[engine]``: the UCI engines that play."""

    path: str | None = None
    """Of any UCI engine; Stockfish if left out."""
    move_time: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    """Thinking time per move [s], a day at most; with a clock the longest. Left out: 0.2 s where there is no clock."""
    nodes: Annotated[int, Field(ge=1, lt=1 << 63)] | None = None
    """Think so many nodes instead: a run then repeats exactly, at full strength."""
    threads: PositiveInt = THREADS
    """Of the search; more than one, and no run repeats exactly."""
    hash_mb: PositiveInt = HASH_MB
    """Memory of the search [MiB]."""
    ponder: bool | None = None
    """Think while others move. Left out: in a game with a clock."""
    options: dict[str, OptionValue] = Field(default_factory=dict)
    """Further UCI options by name, as the engine offers them."""
    book: Path | None = None
    """Opening book in Polyglot's format; without one two engines choose an opening by the seed."""
    book_plies: PositiveInt = 20
    """The book is asked in the first plies only."""
    resigns: bool = False
    """Whether it gives up a lost game. People like to see a game end on the board."""


class SideSection(_Section):
    """``[white]`` and ``[black]``."""

    player: PlayerKind = PlayerKind.ENGINE
    """engine or human."""
    elo: PositiveInt | None = None
    """Strength of the engine; full strength if left out."""
    skill: NonNegativeInt | None = None
    """Strength of the engine by its Skill Level, 0 to 20 of Stockfish, for less than its lowest Elo."""
    path: str | None = None
    """Of this side's own engine."""
    book: Path | None = None
    """Of this side's own."""
    time: str | None = None
    """Time control of this side, if it is another one than the clock's."""


class ClockSection(_Section):
    """``[clock]``."""

    time: str | None = None
    """Time control: 5+3 (minutes and seconds a move), 15+10, 0:30+1, 40/90+30,30+30; no clock if left out."""
    arm_time: ArmTime = ArmTime.NOBODY
    """Who pays for the arm's motion: nobody, or own, the side for which it moves. Even then no flag falls by it."""


class VisionSection(_Section):
    """``[vision]``: what the camera is used for, where there is one."""

    verify: bool | None = None
    """Compare the board with the game after each ply of the arm, and mend what is wrong. Left out: in a lab, and in
    every game against a human."""
    guard: bool | None = None
    """Watch for hands all the time, and hold the arm while one is over the board. Left out: in a lab, and in every game
    against a human."""
    guard_rate: Annotated[float, Field(ge=1.0, le=1000.0)] = 30.0
    """Frames a second that a simulated camera draws for that; a lab's camera has a rate of its own [1/s]."""
    calibration: Path | None = None
    """How the camera hangs and the board lies, as 'touchmove calibrate' wrote it. Left out: the file that a lab's rig
    file names, where there is one; a simulation of our own is believed to be as it is meant."""


class TerminalSection(_Section):
    """``[terminal]``: what is shown and said there."""

    speak: bool = False
    """Moves and requests are spoken aloud, by espeak-ng."""


class PageSection(_Section):
    """``[page]``: what a browser is shown, and who may look."""

    on: bool = True
    """Games against a person, and between engines, can be watched and played in a browser."""
    host: IPv4 = LOOPBACK
    """IPv4 address to listen at; any other than a loopback one wants a password."""
    port: Annotated[int, Field(ge=0, le=65535)] = 8064
    """TCP port; where another game's page has it, any that is free. 0: any that is free."""
    password: Path | None = None
    """File that 'touchmove page --set-password FILE' wrote; who does not know the password sees nothing."""
    address: str | None = None
    """What the browser's address line shows where a proxy stands before the page, such as https://robot.example."""


class Settings(_Section):
    """Everything."""

    rig: RigSection = RigSection()
    game: GameSection = GameSection()
    engine: EngineSection = EngineSection()
    white: SideSection = SideSection()
    black: SideSection = SideSection()
    clock: ClockSection = ClockSection()
    vision: VisionSection = VisionSection()
    terminal: TerminalSection = TerminalSection()
    page: PageSection = PageSection()
    out: Path | None = None
    """Folder of the record; games/<time> if left out."""

    def side(self, white: bool) -> SideSection:
        """Of a colour, as python-chess has it (True is white)."""
        return self.white if white else self.black

    def with_changes(self, changes: Mapping[str, Any]) -> Settings:
        """The tree with some fields changed.

        Args:
            changes: by dotted name such as ``rig.pace``; one that is None changes nothing.

        Raises:
            pydantic.ValidationError: a value is impossible.
        """
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
