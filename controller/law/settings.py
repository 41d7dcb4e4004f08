"""Settings of the control law that are no gains: how it makes up for friction."""

from pydantic import BaseModel, ConfigDict, PositiveFloat


class LawSettings(BaseModel):
    """Settings of the law."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    friction_compensation: bool = True
    """Whether the shafts' viscous and Coulomb friction is fed forward from the measured velocity."""
    coulomb_speed: PositiveFloat = 0.05
    """The Coulomb term's sign is tanh(q̇ / coulomb_speed): no chatter about standstill [rad/s]."""
