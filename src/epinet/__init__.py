"""epinet: depth from light fields.

The names in `__all__` are the public ones; each is imported when it is first used, so that
`import epinet` takes a moment and needs no torch.

>>> import epinet
>>> lf = epinet.read_light_field("scene")      # doctest: +SKIP
>>> result = epinet.load_model().predict(lf)   # doctest: +SKIP
>>> result.save("out")                         # doctest: +SKIP
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from epinet import geometry, io, metrics, networks, synth
    from epinet.camera import Camera
    from epinet.errors import InputError
    from epinet.io import read_light_field, read_pfm, write_light_field, write_pfm
    from epinet.lightfield import LightField
    from epinet.metrics.catalogue import benchmark_metrics
    from epinet.networks.weights import load_weights, save_weights
    from epinet.predict.estimator import Estimator, load_model
    from epinet.predict.result import Result
    from epinet.predict.stored import read_result
    from epinet.synth.generator import render_scene
    from epinet.train import recipe_files as recipes
    from epinet.train.recipe import Recipe
    from epinet.train.recipe_files import load_recipe, shipped_recipes

_HOMES = {
    "Camera": "epinet.camera",
    "Estimator": "epinet.predict.estimator",
    "InputError": "epinet.errors",
    "LightField": "epinet.lightfield",
    "Recipe": "epinet.train.recipe",
    "Result": "epinet.predict.result",
    "benchmark_metrics": "epinet.metrics.catalogue",
    "load_model": "epinet.predict.estimator",
    "load_recipe": "epinet.train.recipe_files",
    "load_weights": "epinet.networks.weights",
    "read_light_field": "epinet.io",
    "read_pfm": "epinet.io",
    "read_result": "epinet.predict.stored",
    "render_scene": "epinet.synth.generator",
    "save_weights": "epinet.networks.weights",
    "shipped_recipes": "epinet.train.recipe_files",
    "write_light_field": "epinet.io",
    "write_pfm": "epinet.io",
}
"""The module that each public name is imported from."""

_MODULES = {
    "geometry": "epinet.geometry",
    "io": "epinet.io",
    "metrics": "epinet.metrics",
    "networks": "epinet.networks",
    "recipes": "epinet.train.recipe_files",
    "synth": "epinet.synth",
}
"""Modules and packages whose content is public, too."""

__all__ = [
    "Camera",
    "Estimator",
    "InputError",
    "LightField",
    "Recipe",
    "Result",
    "benchmark_metrics",
    "geometry",
    "io",
    "load_model",
    "load_recipe",
    "load_weights",
    "metrics",
    "networks",
    "read_light_field",
    "read_pfm",
    "read_result",
    "recipes",
    "render_scene",
    "save_weights",
    "shipped_recipes",
    "synth",
    "write_light_field",
    "write_pfm",
]


def __getattr__(name: str) -> Any:
    """Import on first use: `epinet --help` need not wait for torch."""
    import importlib

    if name in _MODULES:
        return importlib.import_module(_MODULES[name])
    if name not in _HOMES:
        raise AttributeError(f"module 'epinet' has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """The public names, also those that are not imported yet."""
    return sorted({*__all__, *globals()})
