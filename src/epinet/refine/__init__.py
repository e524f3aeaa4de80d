"""What real captures need beside the network: views compensated before, maps refined after."""

from epinet.refine.compensation import compensated
from epinet.refine.holes import refined
from epinet.refine.median import weighted_median

__all__ = ["compensated", "refined", "weighted_median"]
