"""Disk <-> LightField, a module per layout; disparity maps as PFM."""

from epinet.io.convert import layout_for, write_light_field
from epinet.io.pfm import read_pfm, write_pfm
from epinet.io.read import LAYOUTS, is_light_field, named_layout, read_light_field, read_raw

__all__ = [
    "LAYOUTS",
    "is_light_field",
    "layout_for",
    "named_layout",
    "read_light_field",
    "read_pfm",
    "read_raw",
    "write_light_field",
    "write_pfm",
]
