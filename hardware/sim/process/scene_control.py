"""What people around the table do to how it looks: they move the lamp, change the exposure, knock the camera."""

from pathlib import Path
from typing import Any

from hardware.sim.clients import wire
from hardware.sim.plant.plant import Plant
from hardware.sim.process.connections import Service, Visitor
from hardware.sim.render.settings import ExposureSettings, LightSettings, MountSettings, SceneState


class SceneControlService(Service):
    """Keeps how light and camera are from the next exposure on, its ``looks``, and lets visitors change them."""

    def __init__(self, facts: dict[str, Any], plant: Plant, looks: SceneState) -> None:
        super().__init__(facts)
        self.looks, self._plant = looks, plant

    def welcome(self, visitor: Visitor) -> dict[str, Any]:
        """See ``Service``."""
        return {**self._facts, "looks": self.looks.model_dump()}

    def hear(self, visitor: Visitor, message: bytes) -> None:
        """See ``Service``."""
        change = wire.Change.model_validate_json(message)
        given = {name: part for name in wire.Change.model_fields if (part := getattr(change, name)) is not None}
        self.looks = self.looks.model_copy(update=given)
        visitor.tell({"tick": self._plant.tick, "looks": self.looks.model_dump()})


class SceneControl(wire.WorldClient):
    """The client: changes light, exposure and the camera's mount while a world runs."""

    def __init__(self, run_dir: Path) -> None:
        """Connect to the world of a run directory; raises ``HardwareError`` if no world answers."""
        super().__init__(run_dir, "stage")
        self.looks = SceneState.model_validate(self._told["looks"])
        """As they are, from the next exposure on."""

    def change(
        self,
        light: LightSettings | None = None,
        exposure: ExposureSettings | None = None,
        mount: MountSettings | None = None,
    ) -> int:
        """Change what is given, from the returned tick on; raises ``HardwareError`` if the world is gone."""
        parts = {"light": light, "exposure": exposure, "mount": mount}
        wish = {name: part.model_dump() for name, part in parts.items() if part is not None}
        answer = wire.ask(self._link, wish)
        self.looks = SceneState.model_validate(answer["looks"])
        return int(answer["tick"])
