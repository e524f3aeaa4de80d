"""Disk <-> LightField, a module per layout; disparity maps as PFM."""

from epinet.io.convert import check_target, layout_for, left_out, write_light_field
from epinet.io.pfm import read_pfm, write_pfm
from epinet.io.read import (
    LAYOUTS,
    is_light_field,
    is_stray,
    named_layout,
    read_light_field,
    read_raw,
)

__all__ = [
    "LAYOUTS",
    "check_target",
    "is_light_field",
    "is_stray",
    "layout_for",
    "left_out",
    "named_layout",
    "read_light_field",
    "read_pfm",
    "read_raw",
    "write_light_field",
    "write_pfm",
]
