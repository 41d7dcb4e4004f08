"""Games on Lichess from their settings: the account, its rules, the lobby, and the games on a rig."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Final, TypeVar

from app import UserError
from app.online.client import Cut, LichessClient, RequestRefused, Waiting
from app.online.lobby import Lobby, WaitingLines
from app.online.messages import Account
from app.online.terms import pace_of, require_kept, terms_of
from app.online.token import read_token, require_server
from app.play.launch import NO_OTHERS
from app.play.match import last_round, match_of
from app.play.remote_launch import resume_remote_games, run_remote_games
from app.play.session import SessionResult
from app.players.person import Lines
from app.records import EVENTS_FILE, read_events
from app.records.events import StartEvent
from app.rig.simulation.ahead import RigAhead
from app.settings.defaults import OnlineUse, PlayerKind, PracticeSection, Settings
from app.settings.files import kept_settings
from app.terminal.game_display import UserInterface

_T = TypeVar("_T")
_UPGRADE: Final = "--upgrade makes a bot's account of it"


def online_settings(settings: Settings) -> Settings:
    """With who plays here: a person, and then nobody who could help, or an engine of any colour."""
    person = settings.online.use is OnlineUse.PERSON
    white = settings.white.model_copy(update={"player": PlayerKind.HUMAN if person else PlayerKind.ENGINE})
    black = settings.black.model_copy(update={"player": PlayerKind.ENGINE})
    online = settings.online
    if online.token_file is not None:
        online = online.model_copy(update={"token_file": online.token_file.absolute()})
    practice = PracticeSection()  # nobody is taught in a game against somebody else
    return settings.model_copy(update={"white": white, "black": black, "online": online, "practice": practice})


def run_online(
    settings: Settings, ui: UserInterface, lines: Lines, ahead: RigAhead | None = None, waiting: Waiting | None = None
) -> SessionResult:
    """Play on Lichess as the settings say.

    Args:
        settings: as of ``online_settings``.
        ui: shown what happens.
        lines: what is said here.
        ahead: the rig's processes, where they were started before all else.
        waiting: how time passes for who waits for the server; None: by the wall clock.

    Raises:
        UserError: no token, no such account, terms that server or arm do not allow, or as ``run_remote_games``.
        EngineProblem: as ``run_remote_games``.
    """
    said = WaitingLines(lines)
    with ExitStack() as stack:
        lobby = stack.enter_context(_lobby(settings, ui, said, settings.online.game, waiting))
        return run_remote_games(settings, ui, said, lobby, ahead)


def resume_online(
    folder: Path, ui: UserInterface, lines: Lines, engines: Mapping[str, str] = NO_OTHERS,
    waiting: Waiting | None = None,
) -> SessionResult:  # fmt: skip
    """Go on with the games of a folder, first with the one that was left; raises as ``run_online``, engines as of
    ``resume_games``.
    """
    folder = match_of(folder)
    settings = kept_settings(folder)
    path, _, sets_up = last_round(folder)
    start = None if sets_up else next(iter(read_events(path / EVENTS_FILE)), None)
    game = start.site.rsplit("/", 1)[-1] if isinstance(start, StartEvent) else None
    said = WaitingLines(lines)
    with ExitStack() as stack:
        lobby = stack.enter_context(_lobby(settings, ui, said, game, waiting))
        return resume_remote_games(folder, ui, said, lobby, engines=engines)


def _lobby(
    settings: Settings, ui: UserInterface, lines: WaitingLines, going_on: str | None, waiting: Waiting | None
) -> Lobby:
    online, terms = settings.online, terms_of(settings)
    require_kept(terms, pace_of(settings, 0.0))  # before anybody is asked anything
    client = client_of(settings, waiting)
    account = account_here(client, online.use)
    pace = pace_of(settings, client.latency)
    require_kept(terms, pace)
    return Lobby(client, account, online, terms, pace, ui, lines, settings.game.games, going_on)


def client_of(settings: Settings, waiting: Waiting | None = None) -> LichessClient:
    """The server, with the token that the settings name.

    Raises:
        UserError: there is no token, or it would not travel safely.
    """
    server = require_server(settings.online.server)
    return LichessClient(server, read_token(settings.online.token_file, server), waiting)


def account_here(client: LichessClient, use: OnlineUse | None) -> Account:
    """Whose token it is, and that this account may play so.

    Raises:
        UserError: it may not, or the server does not answer.
    """
    account = answered(client, client.account)
    if use is OnlineUse.BOT and not account.is_bot:
        raise UserError(
            f"{account.username} is a person's account, and engines play with a bot's alone: {_UPGRADE}, for ever; or "
            "use --person"
        )
    if use is OnlineUse.PERSON and account.is_bot:
        raise UserError(f"{account.username} is a bot's account, with which no person may play: use --bot")
    return account


def upgrade(client: LichessClient, asked: Callable[[str], str]) -> None:
    """Make the account a bot's, once somebody has said twice that they want that.

    Args:
        client: of the account.
        asked: asks a question, and returns the answer.

    Raises:
        UserError: they do not, or the server does not.
    """
    account = answered(client, client.account)
    if account.is_bot:
        return
    name = account.username
    first = asked(
        f"{name} becomes a bot's account. That cannot be undone: no person can ever play with it again, and it must "
        "not have played a game. Type 'upgrade' to go on: "
    )
    if first.strip() != "upgrade":
        raise UserError(f"{name} was not upgraded: it stays a person's account")
    if asked(f"For ever. Type the account's name, {name}, to do it: ").strip() != name:
        raise UserError(f"{name} was not upgraded: it stays a person's account")
    answered(client, client.upgrade)


def answered(client: LichessClient, question: Callable[[], _T]) -> _T:
    """What the server answers; a UserError where it does not."""
    try:
        return question()
    except RequestRefused as refusal:
        raise UserError(f"{client.server} refuses: {refusal}") from refusal
    except Cut as cut:
        raise UserError(f"{client.server} does not answer ({cut}): look at your network, and at --server") from cut
