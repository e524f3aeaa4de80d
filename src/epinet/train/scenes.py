"""Scenes with truth on disk, for training and validation: those of a folder that apply."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.io.problems import Problems
from epinet.lightfield import LightField
from epinet.predict.batch import find_light_fields

LOGGER = logging.getLogger(__name__)
T = TypeVar("T")


class UnfitError(InputError):
    """A light field that is sound, but not of use: in a folder of others it is left out."""


def usable_scenes(
    paths: Sequence[Path],
    use: Callable[[Path, LightField], T],
) -> Iterator[tuple[Path, T]]:
    """What is made of each scene, read one at a time.

    The log says which scenes of folders are left out.

    Args:
        paths: scenes, or folders of them as `find_light_fields` takes them.
        use: makes something of a scene; raises `UnfitError` where that is not possible.

    Raises:
        InputError: at the end, all that is wrong: scenes that cannot be read, and of those that are
            unfit the ones that `paths` names, or all where no other scene is left.
    """
    problems, unfit = Problems(), Problems()
    used = False
    for path in find_light_fields(paths):
        try:
            found = use(path, read_light_field(path))
        except UnfitError as error:
            (problems if path in paths else unfit).extend(error.problems)
        except InputError as error:
            problems += error.problems
        else:
            used = True
            yield path, found
    if not used:
        problems += unfit
    problems.raise_any()
    for reason in unfit:
        LOGGER.info("left out: %s", reason)


def fitting(path: Path, lf: LightField, views: int) -> LightField:
    """Its central views, as many rows and columns as a network sees.

    Raises:
        UnfitError: it has fewer.
    """
    try:
        return lf.central(views)
    except InputError as error:
        raise UnfitError(error.problems) from error
