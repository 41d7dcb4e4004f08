"""What one seed plays: everything drawn, so that whoever has the task plays the same, wherever that is."""

from __future__ import annotations

import difflib
from typing import Annotated, Any, Final

from pydantic import Field, NonNegativeFloat, NonNegativeInt, PositiveInt, field_validator

from app.campaign.schema import DrawnValue, TaskKind
from app.campaign.tasks.acts import OFTEN, Act
from app.settings.defaults import Settings
from hardware.frozen import FrozenFinite
from hardware.sim.process.randomisation import Randomisation

MOST_LOSS: Final = 0.6
"""Of datagrams: with more of it hardly any answer comes within the link's patience."""
Part = Annotated[float, Field(ge=0.0, le=1.0)]


class CampaignFaults(FrozenFinite):
    """``faults``: what goes wrong in a game on purpose. All by default: nothing."""

    grip: Part = 0.0
    """Share of holds in which the gripper's motor lets go by itself."""
    knocks: NonNegativeInt = 0
    """N: after every N-th ply a hand knocks a piece over, shifts it, or carries it off; 0: never."""
    hands: NonNegativeInt = 0
    """N: in every N-th ply a hand reaches over the board while the arm moves, and the guard watches; 0: never."""
    link_loss: Annotated[float, Field(ge=0.0, le=MOST_LOSS)] = 0.0
    """Share of datagrams between program and controller that are lost, each way."""
    kills: NonNegativeInt = 0
    """So often the program is killed while the arm moves, and resumed."""


class CampaignStart(FrozenFinite):
    """``start``: what a game begins from, and who chooses its moves."""

    plies: Annotated[int, Field(ge=0, le=400)] | None = None
    """So many random plies were played before, of an odd number one more, so that White begins; None: in a session as
    the seed decides, else none."""
    line: bool = False
    """A random line that captures, castles and promotes often is played, from the usual position, by no engine."""


class SessionPlan(FrozenFinite):
    """``session``: what a scripted person does at the board."""

    acts: PositiveInt = 8
    """So often it is their turn."""
    often: dict[Act, NonNegativeFloat] = Field(default_factory=lambda: dict(OFTEN))
    """How often which act is done, in any unit; acts as in ``Act``, such as knock or take_back."""

    @field_validator("often", mode="before")
    @classmethod
    def _by_name(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        names = {act.name.lower(): act for act in Act}
        for key in given:
            if key not in names and key not in set(Act):
                near = difflib.get_close_matches(str(key), names, n=1)
                said = f"did you mean {near[0]}? There are" if near else "choose"
                raise ValueError(f"there is no act {key}: {said} {', '.join(names)}")
        return {names.get(key, key): often for key, often in given.items()}

    @field_validator("often")
    @classmethod
    def _something(cls, often: dict[Act, float]) -> dict[Act, float]:
        if not sum(often.values()):
            raise ValueError("nothing is ever done: give one of the acts a number above 0")
        return often

    @property
    def shares(self) -> dict[Act, float]:
        """Of all acts, what share is which."""
        total = sum(self.often.values())
        return {act: often / total for act, often in self.often.items() if often}


class CampaignTask(FrozenFinite):
    """One seed's game, session or setting up."""

    index: NonNegativeInt
    seed: NonNegativeInt
    kind: TaskKind
    settings: Settings
    """All but the folder."""
    randomisation: Randomisation | None = None
    """None: as a careful lab would be left with."""
    faults: CampaignFaults = CampaignFaults()
    start: CampaignStart = CampaignStart()
    session: SessionPlan = SessionPlan()
    drawn: dict[str, DrawnValue] = Field(default_factory=dict)
    """By the names of the ranges."""

    @property
    def repeatable(self) -> bool:
        """Whether the world ends in the same state each time, to the last bit; see ``GameRow.repeatable``."""
        faults, engine = self.faults, self.settings.engine
        thinks = self.kind is not TaskKind.SETUP and not self.start.line and self.settings.game.moves is None
        by_time = thinks and (engine.nodes is None or engine.threads > 1)
        return not (by_time or faults.hands or faults.link_loss or faults.kills)
