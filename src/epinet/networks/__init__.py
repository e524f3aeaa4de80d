"""Networks: what the program asks of one, those of the package, and their weights."""

from epinet.networks.base import Batch, Network, Settings

__all__ = ["Batch", "Network", "Settings"]
