"""File names: the numbers in them, and which are no user's."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import gcd
from pathlib import Path

_DECIMALS, _WHOLES = re.compile(r"(\d+(?:\.\d+)?)"), re.compile(r"(\d+)")
"""How a name is taken apart: in 1.5 there is one number, or there are two."""
_SPLITS = (_DECIMALS, _WHOLES)
_DOTTED = re.compile(r"\d\.")
_SIGN = re.compile(r"(?:[-+\u2212]|plus|minus|pos|neg|[pmn])$", re.IGNORECASE)
_NEGATIVE = frozenset({"-", "\u2212", "minus", "neg", "m", "n"})
_SAME_ENDINGS = {".jpeg": ".jpg", ".jpe": ".jpg", ".jfif": ".jpg", ".tiff": ".tif"}
_OF_WINDOWS = frozenset({"thumbs.db", "desktop.ini"})


@dataclass(frozen=True, eq=False)
class Field:
    """A number in names that are alike, evenly spaced from the least to the greatest."""

    split: re.Pattern[str]
    """What the numbers of the names are; only those of one split can be told in one name."""
    place: int
    """Which number of a name, from 0."""
    indices: tuple[int, ...]
    """In the order of the files: 0 for the least number, 1 for the next that may stand there."""
    first: int
    step: int
    """The number at index i is first + i * step, with `decimals` of its digits behind the dot."""
    decimals: int
    width: int
    """Digits that it is padded to."""
    signs: Mapping[int, str]
    """What stands before negative numbers (-1), before 0 and before positive ones (1)."""
    by_dots: int
    """How doubtful it is: 0 for a whole number, 1 where dots between digits separate numbers, 2 for
    a fraction."""

    @property
    def count(self) -> int:
        """How many indices there may be."""
        return max(self.indices) + 1

    def text(self, index: int) -> str:
        """How a name has it, sign and all."""
        value = self.first + index * self.step
        whole, fraction = divmod(abs(value), 10**self.decimals)
        number = f"{whole:0{self.width}d}"
        if self.decimals:
            number += f".{fraction:0{self.decimals}d}"
        return self.signs.get(_sign(value), "-" if value < 0 else "") + number


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
    """Split into the largest group of names that differ in their numbers only, and the rest.

    Signs belong to the numbers: -3, +3, m3 and p3. A dot stands within a number or between two,
    whichever makes more names alike. Capitals and small letters are the same, and so are endings,
    unless there are files of the same name that differ in them.
    """
    group = max((_largest_group(files, split) for split in _SPLITS), key=len)
    chosen = set(group)
    return group, [file for file in files if file not in chosen]


def _largest_group(files: list[Path], number: re.Pattern[str]) -> list[Path]:
    groups: dict[tuple[str, ...], list[Path]] = defaultdict(list)
    for file in files:
        groups[_pattern(file, number)].append(file)
    split: list[list[Path]] = []
    for group in groups.values():
        if len({file.stem.lower() for file in group}) == len(group):
            split.append(group)
            continue
        by_ending: dict[str, list[Path]] = defaultdict(list)
        for file in group:
            ending = file.suffix.lower()
            by_ending[_SAME_ENDINGS.get(ending, ending)].append(file)
        split += by_ending.values()
    return max(split, key=len, default=[])


def strangers(folder: Path, is_ours: Callable[[str], object]) -> list[str]:
    """Names in a folder, in order, of what is a user's and not ours by its name."""
    return sorted(p.name for p in folder.iterdir() if is_shown(p) and not is_ours(p.name))


def fields(files: list[Path]) -> list[Field]:
    """The numbers of names that are alike, as far as they differ.

    Example:
        >>> names = ["cam_3_-1.png", "cam_3_0.png", "cam_3_1.png"]
        >>> [(f.text(0), f.indices) for f in fields([Path(name) for name in names])]
        [('-1', (0, 1, 2))]
    """
    splits = [each for each in _SPLITS if len({_pattern(file, each) for file in files}) == 1]
    if not any(_DOTTED.search(file.stem) for file in files):
        del splits[1:]  # they are the same
    found = [
        _field(split, place, tokens)
        for split in splits
        for place, tokens in enumerate(_columns(files, split))
    ]
    return [field for field in found if field is not None]


def renamed(sample: Path, files: list[Path], indices: Mapping[Field, int]) -> str:
    """The name that `sample` would have with these indices; other varying numbers become `*`.

    The fields must be of one split.
    """
    split = next(iter(indices)).split
    by_place = {field.place: field.text(index) for field, index in indices.items()}
    texts, signs, numbers = _parsed(sample.stem, split)
    name = texts[0]
    for place, tokens in enumerate(_columns(files, split)):
        if place in by_place:
            name += by_place[place]
        elif len({(token.sign, token.number) for token in tokens}) > 1:
            name += "*"
        else:
            name += signs[place] + numbers[place]
        name += texts[place + 1]
    return name + sample.suffix


@dataclass(frozen=True)
class _Token:
    """A number of a name as it is written."""

    before: str
    sign: str
    number: str


def _pattern(file: Path, number: re.Pattern[str]) -> tuple[str, ...]:
    return tuple(text.lower() for text in _parsed(file.stem, number)[0])


def _parsed(stem: str, number: re.Pattern[str]) -> tuple[list[str], list[str], list[str]]:
    """The texts around the numbers of a name, the numbers' signs, and the numbers without them."""
    pieces = number.split(stem)
    texts, signs = pieces[::2], []
    for place in range(len(texts) - 1):
        sign = _SIGN.search(texts[place])
        signs.append(sign[0] if sign else "")
        texts[place] = texts[place].removesuffix(signs[-1])
    return texts, signs, pieces[1::2]


def _columns(files: list[Path], number: re.Pattern[str]) -> list[list[_Token]]:
    """By place, how each of the files has its number."""
    rows = []
    for file in files:
        texts, signs, numbers = _parsed(file.stem, number)
        rows.append([_Token(*token) for token in zip(texts[:-1], signs, numbers, strict=True)])
    return [list(column) for column in zip(*rows, strict=True)]


def _field(split: re.Pattern[str], place: int, tokens: list[_Token]) -> Field | None:
    """None where all are the same."""
    signs: dict[int, str] = {}
    values = []
    signed = _is_signed(place, tokens)
    parts = [token.number.partition(".") for token in tokens]
    decimals = max(len(fraction) for _, _, fraction in parts)
    for token, (whole, _, fraction) in zip(tokens, parts, strict=True):
        value = int(whole + fraction.ljust(decimals, "0"))
        if signed and token.sign.lower() in _NEGATIVE:
            value = -value
        values.append(value)
        signs[_sign(value)] = token.sign
    first = min(values)
    step = gcd(*(value - first for value in values))
    if step == 0:
        return None
    padded = [len(whole) for whole, _, _ in parts if whole.startswith("0") and len(whole) > 1]
    return Field(
        split,
        place,
        tuple((value - first) // step for value in values),
        first,
        step,
        decimals,
        min(padded, default=0),
        signs,
        2 if decimals else int(split is _WHOLES),
    )


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)


def _is_signed(place: int, tokens: list[_Token]) -> bool:
    """Whether what stands before the numbers is a sign, and no separator or end of a word.

    A sign differs between files, or stands behind something else than a letter or number.
    """
    seen = {token.sign.lower() for token in tokens}
    if len(seen) > 1:
        return True
    before = tokens[0].before
    at_start = place == 0 and not before
    return not seen & {"p", "m", "n"} and (at_start or not (before or "a")[-1].isalnum())
