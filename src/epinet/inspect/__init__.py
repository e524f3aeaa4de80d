"""What a light field's images say about it: the order of its views, its range of disparities."""

from epinet.inspect.disparity_range import DisparityRange, estimate_range
from epinet.inspect.order import Arrangement, OrderCheck, check_order

__all__ = ["Arrangement", "DisparityRange", "OrderCheck", "check_order", "estimate_range"]
