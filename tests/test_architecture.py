"""Who may import whom, walked in the syntax trees; and what lies at the top of the repository.

All imports count for arrows between rooms and for the referee's rule, wherever they stand. For cycles only those count
that run when a module is loaded: one inside a function runs when the function is called, after everything is loaded.
The program uses those in the command line alone, so that ``--help`` and each process load only what they need.
"""

from __future__ import annotations

import ast
import re
import subprocess
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("app", "controller", "engine", "hardware", "vision")

ALLOWED = {
    "app": ROOMS,
    "controller": (
        "controller",
        "hardware.interfaces",
        "hardware.parameters",
        "hardware.piece_set",
        "hardware.table",
        "hardware.realtime",  # what a punctual process asks of its PC: the simulated world asks for the same
        "hardware.loading",
    ),
    "engine": ("engine",),
    "hardware": ("hardware",),
    "vision": ("vision", "hardware.interfaces", "hardware.loading", "hardware.piece_set", "hardware.table"),
}
"""The arrows: a room and the modules, with all below them, that it may import."""

FLOORS = {
    "app": (
        "cli", "measure", "page", "campaign", "online", "linked", "dataset", "play", "practice", "game", "execution",
        "guard", "commissioning", "rig", "voice", "terminal", "settings", "report", "analysis", "records",
        "motion", "players", "scene", "pieces",
    ),
    "controller": ("offline", "loop", "records", "law", "protection", "wire", "model", "settings", "protocol"),
    "vision": ("standing", "pieces", "reading", "hands", "camera", "loops", "board", "arrays"),
    "hardware": (
        "sim", "drives", "camera", "turned_shapes", "table", "piece_set", "contact_speeds", "referee", "parameters",
        "demands", "frozen", "interfaces", "realtime", "awake", "kernel_workers", "loading",
    ),
    "hardware.sim": ("emulated", "process", "clients", "hand", "plant", "bodies", "render"),
}  # fmt: skip
"""What lies in a room, from the top floor down: each may import what stands after it, and nothing before it."""

MOST_FILES = 15
"""In one folder: as many as a reader takes in."""

KNOW_THE_SIMULATION = (
    "app.rig", "app.measure", "app.campaign", "app.play.simulated_hand", "app.play.hand_moves",
)  # fmt: skip
"""The only modules of ``app`` that may import ``hardware.sim``: the way to a rig, what measures one, and what tells the
simulated person what to do. No other room may."""

KNOW_THE_TRUTH = {
    "app.execution.state": "has the referee among the devices",
    "app.measure.bench.vision.hand_scene": "asks when a hand came",
    "app.campaign.tasks.scripted_person": "plays one who sees where the pieces are",
    "app.measure.bench.unknown.commission": "plays one who measures where the tool is",
    "app.measure.bench.kills": "sees how an arm comes to rest that nobody controls any more",
    "app.pieces.judging": "compares truth and game",
    "app.rig.devices": "hands the referee on to whoever may ask it",
    "app.rig.remote": "opens it",
    "hardware.sim.clients.referee": "is it",
    "hardware.sim.clients.viewer": "is a window for people",
    "hardware.sim.plant.plant": "says what is so",
}
"""The only modules that may import the referee, and what for."""

CHOOSERS = (
    "app.execution.fallen",
    "app.execution.recovery_plans",
    "app.execution.repair",
    "app.motion",
    "app.pieces.layout",
    "app.pieces.manipulation",
    "app.pieces.order",
    "app.pieces.position",
    "app.players",
    "app.rig.arm",
    "controller",
    "engine",
    "vision",
)
"""Choose a move, a grasp or a motion, or carry one out: must not know, even by others, what is really so."""

TOP_LEVEL = {
    "pyproject.toml", "app", "controller", "vision", "engine", "hardware", "tests", "README.md",
    "docs", "Makefile", "LICENSE", "CHANGELOG.md", "constraints.txt",
}  # fmt: skip
"""What may lie at the top of the repository, beside dot files."""


class Import(NamedTuple):
    """One module of ours imported by another; ``deferred`` inside a function."""

    importer: str
    imported: str
    line: int
    deferred: bool

    def __str__(self) -> str:
        return f"{self.importer}:{self.line} imports {self.imported}"


def module_name(path: Path) -> str:
    """Dotted name of a source file; a package is named like its folder."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def files() -> dict[str, Path]:
    """Source file of every module of the program."""
    return {module_name(path): path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))}


@cache
def sources() -> dict[str, ast.Module]:
    """Syntax tree of every module of the program."""
    return {name: ast.parse(path.read_text(encoding="utf-8"), str(path)) for name, path in files().items()}


def below(module: str, *names: str) -> bool:
    """Whether a module is one of these, or lies in one of these packages."""
    return any(module == name or module.startswith(f"{name}.") for name in names)


def imports_of(importer: str, tree: ast.Module, modules: set[str]) -> Iterator[Import]:
    """Imports of one module; ``from package import module`` counts as an import of that module."""

    def walk(node: ast.AST, deferred: bool) -> Iterator[tuple[str, int, bool]]:
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield alias.name, node.lineno, deferred
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{importer}:{node.lineno}: imports are absolute"
            assert node.module is not None
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield (inner if inner in modules else node.module), node.lineno, deferred
        deferred = deferred or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        for child in ast.iter_child_nodes(node):
            yield from walk(child, deferred)

    for name, line, deferred in walk(tree, False):
        if below(name, *ROOMS):
            yield Import(importer, name, line, deferred)


@cache
def all_imports() -> tuple[Import, ...]:
    """Every import of ours by ours."""
    modules = set(sources())
    found = [one for name, tree in sources().items() for one in imports_of(name, tree, modules)]
    unknown = [str(one) for one in found if one.imported not in modules]
    assert not unknown, f"these imports lead nowhere: {unknown}"
    return tuple(found)


def reached_from(module: str) -> dict[str, str]:
    """All modules that a module makes load, each with the one that imports it; a module loads its packages too."""
    edges: dict[str, set[str]] = {}
    for one in all_imports():
        edges.setdefault(one.importer, set()).add(one.imported)
    came: dict[str, str] = {}
    todo = [module]
    while todo:
        here = todo.pop()
        packages = {here.rsplit(".", n)[0] for n in range(1, here.count(".") + 1)}
        for there in edges.get(here, set()) | packages:
            if there not in came and there != module:
                came[there] = here
                todo.append(there)
    return came


def way(came: dict[str, str], start: str, end: str) -> str:
    """How a module is reached."""
    chain = [end]
    while chain[-1] != start:
        chain.append(came[chain[-1]])
    return " → ".join(reversed(chain))


# ----------------------------------------------------------------------------------------------------- the walk itself


def test_the_walk_sees_every_kind_of_import() -> None:
    text = """
import app.one
from app import two
from app.three import function
if True:
    import app.four as four
def f():
    from app import five
    class Inner:
        import app.six
import numpy
"""
    modules = {f"app.{name}" for name in ("one", "two", "three", "four", "five", "six")} | {"app"}
    found = {(one.imported, one.deferred) for one in imports_of("app.x", ast.parse(text), modules)}
    assert found == {
        ("app.one", False), ("app.two", False), ("app.three", False), ("app.four", False),
        ("app.five", True), ("app.six", True),
    }  # fmt: skip


def test_the_walk_reaches_all_rooms() -> None:
    assert {name.split(".")[0] for name in sources()} == set(ROOMS)
    assert len(all_imports()) > 100
    reached = reached_from("app.cli")
    assert {
        "hardware.sim.process.server",
        "controller.law.task_space",
        "engine.process",
        "hardware.sim.clients.referee",
    } <= set(reached)
    assert way(reached, "app.cli", "engine.process").startswith("app.cli → ")


RUNS_WHAT_IT_IS_TOLD = "hardware.sim.emulated.ethercat.enter_namespace"
"""Runs any module, named on its command line, and knows none."""


@pytest.mark.parametrize("module", sorted(set(files()) - {RUNS_WHAT_IT_IS_TOLD}))
def test_nothing_is_imported_behind_the_walks_back(module: str) -> None:
    names = {node.id for node in ast.walk(sources()[module]) if isinstance(node, ast.Name)}
    names |= {node.attr for node in ast.walk(sources()[module]) if isinstance(node, ast.Attribute)}
    names |= {a.name for n in ast.walk(sources()[module]) if isinstance(n, ast.Import) for a in n.names}
    assert not names & {"__import__", "import_module", "importlib", "exec", "eval", "runpy"}


# --------------------------------------------------------------------------------------------------------------- rooms


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_imports_only_what_it_may(room: str) -> None:
    wrong = [str(one) for one in all_imports() if below(one.importer, room) and not below(one.imported, *ALLOWED[room])]
    assert not wrong


def test_no_cycles() -> None:
    graph: dict[str, set[str]] = {name: set() for name in sources()}
    for one in all_imports():
        if not one.deferred:
            graph[one.importer].add(one.imported)
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail("these import each other: " + " ← ".join(error.args[1]))


@pytest.mark.parametrize("room", FLOORS)
def test_no_arrow_runs_back_up(room: str) -> None:
    floors, seen = FLOORS[room], 0
    for one in all_imports():
        if below(one.importer, room) and below(one.imported, room):
            above, beneath = (name.removeprefix(f"{room}.").split(".")[0] for name in (one.importer, one.imported))
            if room in (one.importer, one.imported) or above == beneath:
                continue
            assert above in floors, f"{one}: say on which floor of {room} '{above}' lies"
            assert beneath in floors, f"{one}: say on which floor of {room} '{beneath}' lies"
            assert floors.index(above) < floors.index(beneath), f"{one}, which lies above it"
            seen += 1
    assert seen > 20, "the walk sees the arrows between boxes"


def test_no_folder_holds_more_than_a_reader_takes_in() -> None:
    folders = Counter(path.parent for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    assert len(folders) > 30
    assert not {str(folder.relative_to(ROOT)): n for folder, n in folders.items() if n > MOST_FILES}


def test_a_class_name_stands_for_one_thing() -> None:
    where: dict[str, list[str]] = {}
    for module, tree in sources().items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                where.setdefault(node.name, []).append(module)
    assert len(where) > 500
    assert not {name: modules for name, modules in where.items() if len(modules) > 1}


CHOICES = ("settings", "tree", "rig_file", "randomisation")
"""Modules of what somebody may choose, in a file or on the command line."""


def test_a_default_stands_in_one_place() -> None:
    """A number or word that is written down twice is one day changed in one of the places, and nothing happens."""
    where: dict[tuple[str, object], list[str]] = {}
    for module, tree in sources().items():
        if module.split(".")[-1] not in CHOICES:
            continue
        bodies = [node.body for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
        for field in (one for body in bodies for one in body if isinstance(one, ast.AnnAssign)):
            if isinstance(field.value, ast.Constant) and not isinstance(field.value.value, bool | None):
                where.setdefault((ast.unparse(field.target), field.value.value), []).append(module)
    assert len(where) > 100
    twice = {f"{name} = {value}": modules for (name, value), modules in where.items() if len(modules) > 1 and value}
    assert not twice


LOAD_LATE = {
    "app.cli": "the help must be quick",
    "app.execution": "planning and seeing take seconds to load, and are not needed before something moves",
    "app.linked.identity": "what makes certificates is an extra",
    "app.motion": "the same",
    "app.page.recorded.maker": "makes one thing, with what that alone needs: a record is shown a second sooner",
    "app.play": "opens devices, films and looks, where it does",
    "app.records.telemetry": "the robot in 3-D is shown once it moves, and its kinematics take seconds to load",
    "app.rig.drives": "each driver is loaded where it is wanted: some are extras",
    "app.rig.simulation.processes": "each process loads only what it needs",
    "hardware.sim.emulated.ethercat.process": "makes a network, which takes a process of one thread: before numpy",
    "app.rig.simulation.sim": "the robot's model takes half a second to load, in which the processes start",
}
"""The only packages and modules that import inside functions, and what is loaded late there."""


def test_few_import_inside_functions() -> None:
    late = {one.importer for one in all_imports() if one.deferred}
    assert late
    assert not [module for module in late if not below(module, *LOAD_LATE)]


def test_mujoco_stays_behind_the_seam() -> None:
    for module, tree in sources().items():
        names = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
        names |= {n.module for n in ast.walk(tree) if isinstance(n, ast.ImportFrom) and n.module}
        assert below(module, "hardware.sim") or not any(below(name, "mujoco") for name in names), module


# ------------------------------------------------------------------------------------------------ simulation and truth


def test_few_know_the_simulation() -> None:
    outside = [
        one for one in all_imports() if below(one.imported, "hardware.sim") and not below(one.importer, "hardware.sim")
    ]
    assert len(outside) > 30, "the walk sees those who do"
    assert not [str(one) for one in outside if not below(one.importer, *KNOW_THE_SIMULATION)]


def test_few_know_the_truth() -> None:
    doors = ("hardware.sim.clients.referee", "hardware.referee")
    assert {one.importer for one in all_imports() if below(one.imported, *doors)} == set(KNOW_THE_TRUTH)


@pytest.mark.parametrize("module", sorted(name for name in files() if below(name, *CHOOSERS)))
def test_what_chooses_never_sees_the_truth(module: str) -> None:
    """Neither the referee nor anything else of the simulation is reached, by no number of steps."""
    came = reached_from(module)
    seen = [way(came, module, there) for there in came if below(there, "hardware.sim", "hardware.referee")]
    assert not seen


@pytest.mark.parametrize("chooser", CHOOSERS)
def test_every_chooser_exists(chooser: str) -> None:
    assert any(below(name, chooser) for name in sources())


# ------------------------------------------------------------------------------------------------------ the repository


@cache
def tracked() -> tuple[Path, ...]:
    """Files that the repository holds."""
    command = ["git", "-c", "safe.directory=*", "ls-files", "-z"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if listing.returncode:
        pytest.skip(f"this is no git checkout: {listing.stderr.strip()}")
    return tuple(path for name in listing.stdout.split("\0") if name and (path := ROOT / name).is_file())


def test_the_top_level_holds_only_what_it_may() -> None:
    top = {path.relative_to(ROOT).parts[0] for path in tracked()}
    assert {name for name in top if not name.startswith(".")} <= TOP_LEVEL
    assert all((ROOT / name).exists() for name in TOP_LEVEL)


FORBIDDEN = {
    "a path of one machine": re.compile(r"(?<![\w./:-])/(?:work|root|home/\w+|Users/\w+)(?![\w.-])"),
    "a package registry": re.compile(
        r"\b(?:pypi\.(?:org|python)|pythonhosted\.org|conda\.anaconda|deb\.debian|ghcr\.io)"
    ),
}


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("see " + "/wo" + "rk/main/x", "a path of one machine"),
        ("'/ro" + "ot'", "a path of one machine"),
        ("https://py" + "pi.org/simple", "a package registry"),
    ],
)
def test_the_search_finds(text: str, kind: str) -> None:
    assert FORBIDDEN[kind].search(text)


def test_no_file_names_a_machine_or_a_registry() -> None:
    found = []
    for path in tracked():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            continue  # a picture
        found += [
            f"{path.relative_to(ROOT)} names {kind}: {match.group()}"
            for kind, pattern in FORBIDDEN.items()
            for match in pattern.finditer(text)
        ]
    assert not found
