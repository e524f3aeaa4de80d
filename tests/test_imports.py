"""Imports point one way: a package uses only those in rows above its own."""

import ast
from pathlib import Path

import epinet

SOURCE = Path(epinet.__file__).parent

LAYERS = (
    {"allocator", "errors", "shifts", "squares", "terminal", "texts"},
    {"angular", "arguments", "camera", "progress", "reading", "srgb"},
    {"documents", "lightfield"},
    {"inspect", "metrics", "raw"},
    {"io", "refine"},
    {"geometry", "effects"},
    {"networks"},
    {"synth"},
    {"predict"},
    {"train", "benchmark"},
    {"commands"},
    {"cli"},
)
RANK = {name: rank for rank, names in enumerate(LAYERS) for name in names}


def room(file: Path) -> str:
    """The top-level package or module that a file belongs to."""
    first = file.relative_to(SOURCE).parts[0]
    return first.removesuffix(".py")


def imported_rooms(file: Path) -> set[str]:
    rooms = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: import absolutely"
            names = [node.module or ""]
            names += [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        rooms |= {n.split(".")[1] for n in names if n.startswith("epinet.") and n.count(".")}
    return rooms & set(RANK)


FILES = [f for f in SOURCE.rglob("*.py") if room(f) not in ("__init__", "__main__")]


def test_every_module_has_its_place():
    assert {room(f) for f in FILES} == set(RANK)


def test_imports_point_one_way():
    wrong = [
        f"{file.relative_to(SOURCE)} imports {other}"
        for file in FILES
        for other in imported_rooms(file)
        if RANK[other] >= RANK[room(file)] and other != room(file)
    ]
    assert not wrong
