"""Conventions of the house as tests: floors of imports, no prints below the edges, everything documented."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import shapeprog

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "shapeprog"
FILES = sorted(SOURCE.rglob("*.py"))
LONGEST = 400

FLOORS = {
    "arguments": 0, "errors": 0, "files": 0, "kernels": 0, "lazy_torch": 0, "space": 0,
    "geometry": 1, "language": 2,
    "formats": 3, "data": 4, "library": 5, "inference": 5, "evaluation": 5, "view": 6, "cli": 6, "liang2022": 6,
    "__main__": 6,
}  # fmt: skip
EDGE = 6
PAPER = "liang2022"
COMMANDS_OF_PAPER = "shapeprog.liang2022.cli.app"
HEAVY = {"torch", "numpy", "scipy", "numba", "trimesh", "manifold3d", "matplotlib", "h5py", "rich", "typer"}
NEED_TORCH = {"shapeprog.geometry.scene", "shapeprog.language.unroll"}
"""Modules of the core whose functions import modules that need torch."""
LAZY = {"trimesh", "manifold3d", "matplotlib", "mpl_toolkits", "h5py", "build123d"}


def room_of(path: Path) -> str:
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imported(node: ast.AST) -> list[str]:
    """Full names that an import statement brings in."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        assert node.level == 0, "imports name the package in full"
        return [f"{node.module}.{alias.name}" for alias in node.names]
    return []


def place(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 1)}"


def test_rooms_import_only_downwards() -> None:
    wrong = []
    for path in FILES:
        room = room_of(path)
        if room == "__init__":
            continue
        assert room in FLOORS, f"{path.name}: which floor is the room {room!r} on?"
        for node in ast.walk(tree_of(path)):
            for name in imported(node):
                package, _, rest = name.partition(".")
                if package != "shapeprog":
                    continue
                other = rest.split(".")[0]
                if FLOORS.get(other, 0) > FLOORS[room]:
                    wrong.append(f"{place(path, node)} imports {name}")
    assert wrong == []


def test_rooms_on_one_floor_import_each_other_one_way_only() -> None:
    pairs = set()
    for path in FILES:
        room = room_of(path)
        for node in ast.walk(tree_of(path)):
            for name in imported(node):
                other = name.split(".")[1] if "." in name else ""
                if name.startswith("shapeprog.") and other != room and FLOORS.get(other) == FLOORS.get(room):
                    pairs.add((room, other))
    pairs -= {("cli", PAPER)}  # whose commands are mounted; see below
    assert [pair for pair in pairs if pair[::-1] in pairs] == []


def test_nothing_but_its_own_commands_imports_the_package_of_the_paper() -> None:
    found = []
    for path in FILES:
        if room_of(path) != PAPER:
            names = [(name, place(path, node)) for node in ast.walk(tree_of(path)) for name in imported(node)]
            found += [(name, where) for name, where in names if f"{name}.".startswith(f"shapeprog.{PAPER}.")]
    assert [name for name, _ in found] == [COMMANDS_OF_PAPER], found


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(SOURCE.parent).with_suffix("").parts).removesuffix(".__init__")


def test_no_files_import_each_other_in_a_circle() -> None:
    """Imports inside functions count too: an import that must wait is a circle all the same."""
    modules = {module_of(path): path for path in FILES}
    graph: dict[str, set[str]] = {}
    for module, path in modules.items():
        names = [name for node in ast.walk(tree_of(path)) for name in imported(node)]
        found = {name if name in modules else name.rpartition(".")[0] for name in names}
        graph[module] = found & modules.keys() - {module}
    TopologicalSorter(graph).prepare()  # says which files are in a circle


def test_the_core_imports_inside_functions_only_what_is_heavy() -> None:
    wrong = []
    for path in FILES:
        if FLOORS.get(room_of(path), EDGE) > FLOORS["language"]:
            continue
        for function in ast.walk(tree_of(path)):
            for node in ast.walk(function) if isinstance(function, ast.FunctionDef) else ():
                heavy = {name.split(".")[0] for name in imported(node)} <= HEAVY | LAZY
                if not heavy and module_of(path) not in {"shapeprog.kernels.compile", *NEED_TORCH}:
                    wrong.append(place(path, node))
    assert wrong == []


def test_only_the_edges_print() -> None:
    wrong = []
    for path in FILES:
        inner = room_of(path) == PAPER and path.stem not in ("cli", "plots")
        if FLOORS.get(room_of(path)) == EDGE and not inner:
            continue
        for node in ast.walk(tree_of(path)):
            calls = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            plots = any(name.split(".")[0] in ("matplotlib", "rich", "typer") for name in imported(node))
            if calls or plots:
                wrong.append(place(path, node))
    assert wrong == []


def public(body: list[ast.stmt]) -> list[ast.ClassDef | ast.FunctionDef]:
    return [n for n in body if isinstance(n, (ast.ClassDef, ast.FunctionDef)) and not n.name.startswith("_")]


def test_every_public_name_is_documented() -> None:
    wrong = []
    for path in FILES:
        tree = tree_of(path)
        if not ast.get_docstring(tree):
            wrong.append(place(path, tree))
        for node in public(tree.body):
            inner = public(node.body) if isinstance(node, ast.ClassDef) else []
            wrong += [f"{place(path, each)} {each.name}" for each in [node, *inner] if not ast.get_docstring(each)]
    assert wrong == []


def test_files_are_short() -> None:
    long = {str(path.relative_to(ROOT)): len(path.read_text().splitlines()) for path in FILES}
    assert {name: lines for name, lines in long.items() if lines > LONGEST} == {}


def test_nothing_names_a_place_on_one_machine() -> None:
    wrong = re.compile(r"""["'\s(=](/(home|root|work|tmp|usr|opt|mnt|Users)/|[A-Z]:\\\\)""")
    files = [*FILES, *ROOT.glob("*.toml"), *ROOT.glob("*.txt"), *ROOT.glob("*.md"), ROOT / "Makefile"]
    files += [*(ROOT / "examples").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
    assert [str(path.relative_to(ROOT)) for path in files if path.exists() and wrong.search(path.read_text())] == []


def test_heavy_libraries_load_where_they_are_used() -> None:
    """Readers, meshes and figures cost seconds; their modules import them inside functions."""
    wrong = []
    for path in FILES:
        for node in tree_of(path).body:
            names = {name.split(".")[0] for name in imported(node)}
            if names & LAZY:
                wrong.append(place(path, node))
    assert wrong == []


def run_python(code: str) -> str:
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_importing_the_package_loads_nothing_heavy() -> None:
    found = run_python("import sys, shapeprog; print(*{name.split('.')[0] for name in sys.modules})").split()
    assert set(found) & HEAVY == set()


@pytest.mark.parametrize(
    "module",
    ["geometry.voxelise_kernels", "formats.format", "inference.cells.block_kernels", "view.raster_kernels"],
)
def test_a_module_loads_nothing_of_its_room_but_what_it_needs(module: str) -> None:
    found = run_python(f"import sys, shapeprog.{module}; print(*{{name.split('.')[0] for name in sys.modules}})")
    assert "torch" not in found.split()


def test_help_loads_no_heavy_library() -> None:
    """The suffixes it lists are declared without the libraries that write them."""
    code = (
        "import sys; from shapeprog.cli import main\ntry: main(['export', '--help'])\n"
        "except SystemExit: print(*{name.split('.')[0] for name in sys.modules})"
    )
    assert set(run_python(code).splitlines()[-1].split()) & {"torch", "numba", *LAZY} == set()


def test_importing_the_core_loads_no_heavy_library_but_numpy() -> None:
    code = "import sys, shapeprog.language, shapeprog.language.printer; print(*{n.split('.')[0] for n in sys.modules})"
    assert set(run_python(code).split()) & (HEAVY | LAZY) - {"numpy"} == set()


def test_public_names_are_found_where_they_are_said_to_be() -> None:
    for name in shapeprog.__all__:
        assert getattr(shapeprog, name) is not None
        assert name in dir(shapeprog)
    with pytest.raises(AttributeError, match="attribute parser"):
        _ = shapeprog.parser  # type: ignore[attr-defined]


def test_the_modules_of_the_paper_that_pages_name_are_found_without_an_import() -> None:
    code = (
        "from shapeprog import liang2022 as p\nprint(p.renderer.SKIN, p.losses.DECAY, p.prior.BLOCKS, p.settings.LOG)"
    )
    assert run_python(code) == "0.0001 0.9 10 log.jsonl"
    code = "import shapeprog.liang2022.decode, shapeprog as sp; print(callable(sp.liang2022.decode))"
    assert run_python(code) == "True"


def test_type_checkers_see_the_names_that_are_resolved_lazily() -> None:
    """The names that a stub hands on are those that it lists, and those that the package has."""
    for stub in SOURCE.rglob("__init__.pyi"):
        tree = tree_of(stub)
        seen = {alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names}
        listed = next(node.value for node in tree.body if isinstance(node, ast.Assign))
        room = ".".join(("shapeprog", *stub.parent.relative_to(SOURCE).parts))
        assert seen == set(ast.literal_eval(listed)) == set(importlib.import_module(room).__all__)


def test_functions_survive_the_import_of_the_modules_they_are_in() -> None:
    code = "import shapeprog.inference.infer, shapeprog.inference as i, shapeprog as sp; print(i.infer is sp.infer)"
    assert run_python(code) == "True"
