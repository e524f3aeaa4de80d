"""All metrics, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from epinet.errors import InputError
from epinet.metrics.disparity import BADPIX_THRESHOLDS_PX
from epinet.metrics.general import MAE, MISSING, MSE, Q25, RMSE, RUNTIME, badpix
from epinet.metrics.metric import Metric
from epinet.metrics.regions import DISCONTINUITIES, FINE_FATTENING, FINE_THINNING, PARTS
from epinet.metrics.stratified import STRATIFIED
from epinet.metrics.surfaces import BUMPINESS, NORMALS


def benchmark_metrics(
    thresholds_px: Sequence[float] = BADPIX_THRESHOLDS_PX,
) -> tuple[Metric, ...]:
    """Every metric of the 4D Light Field Benchmark, and a few of the paper's and our own.

    Args:
        thresholds_px: of the BadPix of all pixels; the regions' own stay the benchmark's.

    Raises:
        InputError: thresholds that are no positive numbers.

    Example:
        >>> len(benchmark_metrics()), len({m.id for m in benchmark_metrics()})
        (31, 31)
    """
    useless = [t for t in thresholds_px if not (isfinite(t) and t > 0)]
    if useless:
        raise InputError(
            [f"BadPix({t:g}): the threshold must be a positive number" for t in useless]
        )
    return (
        *{metric.id: metric for metric in map(badpix, thresholds_px)}.values(),
        *(MSE, Q25, RMSE, MAE, MISSING, RUNTIME),
        *(DISCONTINUITIES, FINE_FATTENING, FINE_THINNING),
        *BUMPINESS,
        *NORMALS,
        *PARTS,
        *STRATIFIED,
    )
