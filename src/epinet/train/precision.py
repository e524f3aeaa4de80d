"""Which devices compute in bfloat16 themselves."""

from __future__ import annotations

from functools import cache

import torch

NATIVE = ("_is_avx512_bf16_supported", "_is_amx_tile_supported")
"""What torch tells of a CPU; without either, a convolution in bfloat16 is emulated, and takes many
times as long as in float32."""


@cache
def computes_bf16(device: torch.device) -> bool:
    """Whether a device multiplies in bfloat16 without emulating it."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    if device.type != "cpu":
        return True
    return any(getattr(torch.cpu, name, lambda: False)() for name in NATIVE)
