"""Networks by name: those that come with the package, those of packages installed beside it, and
classes of the user's own."""

from __future__ import annotations

import importlib
import inspect
import sys
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from epinet.documents import short
from epinet.errors import InputError
from epinet.networks.base import Network

OURS = {
    "sweepnet": "epinet.networks.sweepnet:SweepNet",
    "epinet": "epinet.networks.epinet:Epinet",
}
"""The first is used unless told otherwise."""

DEFAULT_MODEL = next(iter(OURS))

GROUP = "epinet.networks"
"""Entry points of this group name networks: mynet = "my_package.my_module:MyNet"."""


@cache
def known() -> dict[str, str]:
    """Where the classes of the networks are that have a name, "module:class" each."""
    return OURS | {point.name: point.value for point in entry_points(group=GROUP)}


def network_type(name: str) -> type[Network[Any]]:
    """The class of a network.

    Args:
        name: of `known`, or "my_package.my_module:MyNet". The module is imported, which runs its
            code; one in the current folder is found, too.

    Raises:
        InputError: there is none of that name.
    """
    module, colon, kind = known().get(name, name).partition(":")
    if not colon:
        raise InputError(
            f"model {short(name)}: there are {', '.join(known())}; one of your own is named "
            "my_package.my_module:MyNet"
        )
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        importlib.import_module(module)
    except ImportError as error:
        raise InputError(f"model {short(name)}: {error}") from error
    finally:
        if here in sys.path:
            sys.path.remove(here)
    return _class(name, module, kind)


def network_type_of_file(name: str) -> type[Network[Any]]:
    """The class of the network that a weights file names: no module is imported for its sake but
    those of `known`.

    Raises:
        InputError: there is none of that name, or its module was not imported before.
    """
    if name in known():
        return network_type(name)
    module, colon, kind = name.partition(":")
    if not colon or module not in sys.modules:
        raise InputError(
            f"weights of a network {short(name)}, which is none of {', '.join(known())}; give "
            f"--model {short(name)} if that is code of yours (load_model(..., model=...) in Python)"
        )
    return _class(name, module, kind)


def name_of(kind: type[Network[Any]]) -> str:
    """The name by which `network_type` finds a class."""
    path = f"{kind.__module__}:{kind.__qualname__}"
    for name, where in known().items():
        module, _, member = where.partition(":")
        if getattr(sys.modules.get(module), member, None) is kind:
            return name
    return path


def folder_of_weights(kind: type[Network[Any]]) -> Path:
    """Where the weights lie that come with a network: `weights` beside its module."""
    return Path(inspect.getfile(kind)).parent / "weights"


def _class(name: str, module: str, kind: str) -> type[Network[Any]]:
    found = getattr(sys.modules[module], kind, None)
    if not (isinstance(found, type) and issubclass(found, Network)):
        raise InputError(f"model {short(name)}: {module} has no class {kind} that is a Network")
    return found
