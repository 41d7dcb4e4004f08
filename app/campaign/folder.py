"""The folder of a campaign: what it is, kept so that the same command goes on and any seed can be played again."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from pydantic import PositiveInt

from app import UserError
from app.campaign.drawing import check_ranges
from app.campaign.environment import CampaignEnvironment
from app.campaign.named_files import beside, require_named
from app.campaign.spec import CampaignSpec, DrawRange
from app.records.files import recording, write_atomically
from app.settings.toml import ConfigError, load_toml, toml_value
from hardware.frozen import Frozen

CAMPAIGN_FILE: Final = "campaign.toml"
_LOCK: Final = ".campaign.lock"


class CampaignFolderError(UserError):
    """A folder holds no campaign, or another one."""


class KeptCampaign(Frozen):
    """``campaign.toml``."""

    games: PositiveInt
    """So many it has; grows when the same campaign is asked for more."""
    spec: CampaignSpec
    environment: CampaignEnvironment


def load_spec(path: Path) -> CampaignSpec:
    """Read a campaign's file; files that it names are looked for beside it.

    Raises:
        ConfigError: it cannot be read, something in it is wrong, a range leads out of what is possible, or what it
            names is not there.
    """
    spec = load_toml(path, CampaignSpec, "campaign", "docs/examples holds some to begin with")
    spec = spec.model_copy(update={"draw": dict(beside(path.absolute().parent, spec.draw))})
    try:
        check_ranges(spec)
        require_named(spec.draw)
    except (ValueError, ConfigError) as error:
        raise ConfigError(f"campaign file {path}: {error}") from error
    return spec


def kept_campaign(folder: Path) -> KeptCampaign:
    """What a folder is the campaign of.

    Raises:
        UserError: it holds none, or one of another version.
    """
    path = folder / CAMPAIGN_FILE
    if not path.is_file():
        raise CampaignFolderError(
            f"{folder} holds no campaign: name a folder that 'touchmove campaign' was told by --out"
        )
    return load_toml(path, KeptCampaign, "campaign", "name the folder of a campaign")


def keep_campaign(folder: Path, wanted: KeptCampaign) -> KeptCampaign:
    """Make a folder that of a campaign, or go on with the one that it holds; what it holds then.

    Raises:
        UserError: it holds another campaign, one of another environment, or cannot be written.
    """
    with recording(folder):
        folder.mkdir(parents=True, exist_ok=True)
    if not (folder / CAMPAIGN_FILE).exists():
        _require_empty(folder)  # before anything is left in somebody else's
    with one_at_a_time(folder):
        if not (folder / CAMPAIGN_FILE).exists():
            _require_empty(folder)
            _write(folder, wanted)
            return wanted
        kept = kept_campaign(folder)
        _require_same(folder, kept, wanted)
        if wanted.games > kept.games:
            kept = kept.model_copy(update={"games": wanted.games})
            _write(folder, kept)
        return kept


@contextmanager
def one_at_a_time(folder: Path) -> Iterator[None]:
    """Only one program, of all shards that work in the folder, is here at a time."""
    with recording(folder / _LOCK), (folder / _LOCK).open("ab") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _require_empty(folder: Path) -> None:
    strange = next((path.name for path in sorted(folder.iterdir()) if path.name != _LOCK), None)
    if strange is not None and not (folder / CAMPAIGN_FILE).exists():  # another program may just have begun it
        raise CampaignFolderError(f"{folder} holds {strange}, and no campaign: choose another folder with --out")


def _require_same(folder: Path, kept: KeptCampaign, wanted: KeptCampaign) -> None:
    if kept.spec != wanted.spec:
        raise CampaignFolderError(
            f"{folder} holds another campaign ({_unlike(kept.spec, wanted.spec)}): choose another folder with --out"
        )
    if found := kept.environment.differences(wanted.environment):
        raise CampaignFolderError(
            f"the campaign in {folder} was begun in another environment ({'; '.join(found)}): go on where it was "
            "begun, or begin a new one in another folder with --out"
        )


def _unlike(kept: CampaignSpec, wanted: CampaignSpec) -> str:
    """The first difference, for people."""
    here, there = kept.model_dump(by_alias=True), wanted.model_dump(by_alias=True)
    named = {
        **{f"draw.{name}": None for name in {**here["draw"], **there["draw"]}},
        "kind": 0,
        "first_seed": 0,
        "title": 0,
    }
    flat = [{**one, **{f"draw.{name}": value for name, value in one["draw"].items()}} for one in (here, there)]
    name = next(name for name in named if flat[0].get(name) != flat[1].get(name))
    return f"{name} is {flat[0].get(name, 'missing')} there, and {flat[1].get(name, 'missing')} here"


def _write(folder: Path, campaign: KeptCampaign) -> None:
    spec = campaign.spec
    lines = [
        "# A campaign of Touchmove, as it was begun; the same command goes on with it.",
        f"games = {campaign.games}", "", "[spec]",
        *(f"{name} = {toml_value(getattr(spec, name))}" for name in ("kind", "first_seed", "title")), "",
        "[spec.draw]",
        *(f"{json.dumps(name)} = {toml_value(_plain(value))}" for name, value in spec.draw.items()), "",
        "[environment]",
        *(f"{name} = {toml_value(value)}" for name, value in campaign.environment),
    ]  # fmt: skip
    write_atomically(folder / CAMPAIGN_FILE, "\n".join(lines) + "\n")


def _plain(value: Any) -> Any:
    return value.model_dump(by_alias=True) if isinstance(value, DrawRange) else value
