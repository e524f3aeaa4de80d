"""epinet: depth from light fields.

>>> import epinet
>>> lf = epinet.read_light_field("scene")      # doctest: +SKIP
>>> result = epinet.load_model().predict(lf)   # doctest: +SKIP
>>> result.save("out")                         # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

__all__ = ["InputError", "LightField", "load_model", "read_light_field", "write_light_field"]

if TYPE_CHECKING:
    from epinet.errors import InputError
    from epinet.io import read_light_field, write_light_field
    from epinet.lightfield import LightField
    from epinet.predict.estimator import load_model

_HOMES = {
    "InputError": "epinet.errors",
    "LightField": "epinet.lightfield",
    "load_model": "epinet.predict.estimator",
    "read_light_field": "epinet.io",
    "write_light_field": "epinet.io",
}


def __getattr__(name: str) -> Any:
    """Import on first use: `epinet --help` need not wait for torch."""
    if name not in _HOMES:
        raise AttributeError(f"module 'epinet' has no attribute {name!r}")
    import importlib

    return getattr(importlib.import_module(_HOMES[name]), name)
