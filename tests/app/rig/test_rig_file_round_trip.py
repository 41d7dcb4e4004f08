"""A rig file that the program writes for a simulation of its own is read as the same rig."""

from __future__ import annotations

from pathlib import Path
from shutil import copytree
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.rig.rig_file import RIG_FILE, RigFile, WorldSection, load_rig, save_rig
from app.rig.simulation.settings import own_rig, world_settings
from app.settings.toml import ConfigError
from hardware.interfaces import Pace
from hardware.piece_set import Colour
from hardware.sim.process.randomisation import Randomisation
from hardware.sim.render.settings import CameraSettings, LightSettings, MountSettings
from hardware.table import Captured, TableSettings

METRES = st.floats(-0.05, 0.05)
WORLDS = st.builds(
    WorldSection,
    pace=st.sampled_from(Pace), seed=st.integers(0, 2**63 - 1), cameras=st.booleans(), linger=st.floats(0.0, 1e6),
    fen=st.sampled_from([None, "8/8/4k3/8/8/4K3/4P3/8 w - - 0 1"]), person=st.sampled_from([None, *Colour]),
    camera=st.builds(CameraSettings, mount=st.builds(MountSettings, shift=st.tuples(METRES, METRES, METRES))),
    light=st.builds(LightSettings, radius=st.floats(0.0, 0.3)),
    randomisation=st.builds(Randomisation, board_shift=st.floats(0.0, 1e-3)),
)  # fmt: skip
CONTROLLERS = st.fixed_dictionaries(
    {}, optional={"port": st.integers(0, 65535), "linger": st.floats(1e-3, 1e6) | st.just(float("inf"))}
)
TABLES = st.builds(TableSettings, square=st.floats(0.03, 0.05), captured=st.sampled_from(Captured))


@given(WORLDS, CONTROLLERS, TABLES)
def test_what_is_written_is_read_back(
    tmp_path_factory: pytest.TempPathFactory, world: WorldSection, controller: dict[str, Any], table: TableSettings
) -> None:
    rig = own_rig(tmp_path_factory.mktemp("rig"), world, controller, table=table)
    save_rig(rig, rig.run_dir / RIG_FILE)
    assert load_rig(rig.run_dir / RIG_FILE) == rig


def test_a_run_directory_may_be_moved_with_its_rig(tmp_path: Path) -> None:
    rig = own_rig(tmp_path / "before", WorldSection())
    rig.run_dir.mkdir()
    save_rig(rig, rig.run_dir / RIG_FILE)
    copytree(rig.run_dir, tmp_path / "after")
    moved: RigFile = load_rig(tmp_path / "after" / RIG_FILE)
    assert moved.run_dir == tmp_path / "after"
    assert moved.controller.key.parent == tmp_path / "after"


def test_a_position_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"world\.fen is not a position: "):
        world_settings(own_rig(tmp_path, WorldSection(fen="8/8 w")))
