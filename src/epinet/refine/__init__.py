"""Maps of real captures made better afterwards, guided by the centre view."""

from epinet.refine.holes import refined
from epinet.refine.median import weighted_median

__all__ = ["refined", "weighted_median"]
