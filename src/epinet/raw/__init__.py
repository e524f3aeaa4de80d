"""Raw files of plenoptic cameras (Lytro F01 and Illum): from the sensor's pixels to views."""

from epinet.raw.decoder import DEFAULT_VIEWS, decode

__all__ = ["DEFAULT_VIEWS", "decode"]
