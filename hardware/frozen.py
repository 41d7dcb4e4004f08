"""Base classes of settings and reports that do not change: strict about names, so that a misspelt one is refused."""

from pydantic import BaseModel, ConfigDict


class Frozen(BaseModel):
    """Data that does not change; a name that it does not have is refused."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class FrozenFinite(Frozen):
    """Of finite numbers alone: what devices are set to."""

    model_config = ConfigDict(allow_inf_nan=False)
