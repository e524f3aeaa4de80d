"""EPINET, the network of the paper."""

from epinet.networks.epinet.layers import EpinetConfig
from epinet.networks.epinet.network import Epinet, EpinetSettings

__all__ = ["Epinet", "EpinetConfig", "EpinetSettings"]
