"""File names: the numbers in them, and which are no user's."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path

from epinet.errors import InputError

_NUMBER = re.compile(r"\d+(?:\.\d+)?")
_OF_WINDOWS = frozenset({"thumbs.db", "desktop.ini"})


def is_shown(path: Path) -> bool:
    """Whether it is a file that people see, not one that a system keeps beside theirs."""
    return not path.name.startswith(".") and path.name.lower() not in _OF_WINDOWS


def named_path(path: Path) -> Path:
    """The absolute path under the name that the user gave: `.` has one, too, and a link keeps its
    own, while the folders above are those that it truly lies in."""
    absolute = path.absolute()
    if absolute.name in ("", ".."):
        return absolute.resolve()
    return absolute.parent.resolve() / absolute.name


def folder_name(folder: Path) -> str:
    """What a folder is called where it stands."""
    return named_path(folder).name


def alike(files: list[Path]) -> tuple[list[Path], list[Path]]:
    """Split into the largest group of names that differ in their numbers only, and the rest."""
    groups: dict[str, list[Path]] = defaultdict(list)
    for file in files:
        groups[re.sub(rf"-?{_NUMBER.pattern}", "#", file.name)].append(file)
    group = max(groups.values(), key=len, default=[])
    return group, [file for file in files if file not in group]


def one_kind(files: list[Path]) -> tuple[list[Path], list[Path]]:
    """Split as `alike` does, where it is plain which group is the largest.

    Raises:
        InputError: as many files of another group, naming one of each: which of them are the
            views is anyone's guess.
    """
    group, rest = alike(files)
    others, _ = alike(rest)
    if len(others) == len(group) > 1:
        raise InputError(
            f"{group[0].parent}: {len(group)} images named like {group[0].name} and as many like "
            f"{others[0].name}; leave only the views in the folder"
        )
    return group, rest


def strangers(folder: Path, is_ours: Callable[[str], object]) -> list[str]:
    """Names in a folder, in order, of what is a user's and not ours by its name."""
    return sorted(p.name for p in folder.iterdir() if is_shown(p) and not is_ours(p.name))


def integer_fields(files: list[Path]) -> dict[int, list[int]]:
    """The values of each number of names that are alike, if whole in all of them.

    Keys count the numbers of a name from 0; "out_00_16_-776.88_" has fields 0 and 1.
    """
    rows = [_NUMBER.findall(file.stem) for file in files]
    columns = enumerate(zip(*rows, strict=True))
    return {i: [int(text) for text in column] for i, column in columns if _all_whole(column)}


def renumbered(sample: Path, numbers: Mapping[int, int]) -> str:
    """The name of `sample` with other numbers in some fields; fractional ones become `*`."""
    fields = iter(range(len(sample.stem)))

    def replacement(match: re.Match[str]) -> str:
        field = next(fields)
        if field in numbers:
            width = len(match[0]) if match[0].startswith("0") else 0
            return f"{numbers[field]:0{width}d}"
        return "*" if "." in match[0] else match[0]

    return _NUMBER.sub(replacement, sample.stem) + sample.suffix


def _all_whole(texts: tuple[str, ...]) -> bool:
    return all(text.isdecimal() for text in texts)
