"""SweepNet, a plane sweep whose costs a small network judges (docs/sweepnet.md)."""

from epinet.networks.sweepnet.layers import SweepNetConfig
from epinet.networks.sweepnet.network import SweepNet, SweepNetSettings

__all__ = ["SweepNet", "SweepNetConfig", "SweepNetSettings"]
