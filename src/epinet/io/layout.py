"""What a layout on disk is: a name, and how to recognise, read and write it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from epinet.lightfield import LightField


@dataclass(frozen=True)
class Layout:
    """A way in which light fields lie on disk; each module of a layout ends by stating its own."""

    name: str
    description: str
    """One line for the user: what the folder or file holds."""
    recognises: Callable[[Path], bool]
    """Whether a folder (or file) looks like this layout. May be wrong about a broken one."""
    read: Callable[[Path], LightField]
    """Raises InputError with all that is wrong."""
    write: Callable[[Path, LightField], None] | None
    """Fills an empty folder, or writes a file; None where it can only be read."""
    suffixes: tuple[str, ...] = ()
    """Of its files; empty for a layout that is a folder."""
    file_names: str = ""
    """Pattern of the names of all files that `write` may put into a folder."""
    holds_views: Callable[[Path], bool] = lambda path: True
    """Whether a file that is recognised by its name holds views by its header, damaged or not."""
    rendered: bool = False
    """What lies in it is rendered unless it says otherwise; else a camera took it."""

    @property
    def is_folder(self) -> bool:
        return not self.suffixes

    def fits(self, path: Path) -> bool:
        """Whether a folder or file looks like this layout, be it whole or damaged."""
        return self.is_folder == path.is_dir() and self.recognises(path)
