"""All that `epinet info` says of a light field: what was read, and what was measured."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from epinet.inspect.alignment import estimate_alignment
from epinet.inspect.disparity_range import NOTHING_MATCHES, DisparityRange, estimate_range
from epinet.inspect.order import OrderCheck, check_order
from epinet.inspect.spacing import row_spacing, stretched
from epinet.inspect.sweep import load_star
from epinet.lightfield import LightField

RANGE_TOLERANCE_PX = 0.3
"""The estimated range is no better than this."""


def inspect(lf: LightField, trained_range_px: tuple[float, float] | None) -> dict[str, Any]:
    """Facts and measurements as plain values, fit for JSON.

    Args:
        lf: as it was read and, where asked for, reordered.
        trained_range_px: disparities that the network was trained for, if known.
    """
    lf = lf.brightened()
    order = check_order(lf)
    ordered = order.correction.apply(lf)
    spacing = row_spacing(order.spacing)
    ordered = stretched(ordered, spacing)
    span, alignment = estimate_range(ordered), estimate_alignment(ordered)
    if span is not None:
        span = span.divided(max(1.0, spacing))
    height, width = lf.size
    return {
        "input": None if lf.source is None else str(lf.source),
        "layout": lf.layout,
        "grid": {"rows": lf.grid[0], "columns": lf.grid[1], "present": int(lf.present.sum())},
        "reference_view": lf.reference,
        "size_px": {"height": height, "width": width},
        "bits": lf.bits,
        "channels": lf.views.shape[-1],
        "camera": None if lf.camera is None else lf.camera.as_dict(),
        "truth": _truth(lf),
        "masks": {name: round(float(mask.mean()), 4) for name, mask in lf.masks.items()},
        "order": _order(order),
        "row_spacing": round(spacing, 3),
        "has_texture": load_star(lf).has_texture,
        "disparity_px": None if span is None else asdict(span),
        "captured": lf.captured,
        "alignment": None if alignment is None else alignment.as_dict(),
        "notes": list(lf.notes),
        "warnings": _warnings(order, span, trained_range_px),
    }


def report_lines(report: dict[str, Any]) -> list[str]:
    """The report for a terminal, a line for each fact."""
    grid, size = report["grid"], report["size_px"]
    views = f"{grid['rows']}x{grid['columns']}"
    total = grid["rows"] * grid["columns"]
    if grid["present"] < total:
        views += f", {grid['present']} of {total} present"
    colour = "gray" if report["channels"] == 1 else "RGB"
    facts = {
        "layout": report["layout"],
        "views": f"{views}; reference view: {report['reference_view']}",
        "size": f"{size['width']}x{size['height']} px, {report['bits']}-bit {colour}",
        "camera": _camera_text(report["camera"]),
        "truth": _truth_text(report["truth"]),
        "masks": ", ".join(f"{n} ({100 * s:.1f} %)" for n, s in report["masks"].items()),
        "order": report["order"]["verdict"],
        "spacing": ""
        if report["row_spacing"] == 1
        else f"rows are {report['row_spacing']:.2f} times as far apart as columns (measured); "
        "disparities are per adjacent column",
        "disparity": _disparity_text(report),
        "alignment": _alignment_text(report["alignment"]),
    }
    lines = [str(report["input"])]
    lines += [f"  {name + ':':<11}{text}" for name, text in facts.items() if text]
    lines += [f"  note: {note}" for note in report["notes"]]
    lines += [f"  warning: {warning}" for warning in report["warnings"]]
    return lines


def _truth(lf: LightField) -> dict[str, float] | None:
    if lf.truth is None:
        return None
    known = np.isfinite(lf.truth)
    return {
        "min_px": float(lf.truth[known].min()),
        "max_px": float(lf.truth[known].max()),
        "known": float(known.mean()),
    }


def _order(check: OrderCheck) -> dict[str, Any]:
    return {
        "verdict": check.verdict,
        "consistent": check.is_consistent,
        "flags": list(check.flags),
        "grid_decided": check.decided_grid,
        "grid_margin": round(check.grid_margin, 3) if np.isfinite(check.grid_margin) else None,
        "sign_decided": check.decided_sign,
        "votes_for": check.votes.near,
        "votes_against": check.votes.far,
    }


def _warnings(
    order: OrderCheck, span: DisparityRange | None, trained: tuple[float, float] | None
) -> list[str]:
    warnings = []
    if not order.is_grid:
        warnings.append(order.verdict)
    elif order.is_consistent is False:
        unsure = "" if order.decided_sign else " (the wrong one of them reverses the sign)"
        warnings.append(f"the views stand in the wrong order; give: {order.remedy}{unsure}")
    if span is not None and trained is not None:
        low, high = trained
        outside = span.min_px < low - RANGE_TOLERANCE_PX or span.max_px > high + RANGE_TOLERANCE_PX
        if outside or span.hits_limit:
            reach = max(span.min_px / low, span.max_px / high) if low < 0 < high else 2.0
            warnings.append(
                f"disparities of {span} exceed the {low:g}..{high:g} px that the network was "
                f"trained for; try: epinet predict --scale {max(2, int(np.ceil(reach)))}"
            )
    return warnings


def _camera_text(camera: dict[str, Any] | None) -> str:
    if camera is None:
        return "unknown (no metric depth)"
    focus = float(camera["focus_distance_mm"])
    text = (
        f"focal length {camera['focal_length_mm']:g} mm, sensor {camera['sensor_size_mm']:g} mm, "
        f"baseline {camera['baseline_mm']:g} mm, focus at {focus:.0f} mm"
    )
    low, high = camera["disparity_min_px"], camera["disparity_max_px"]
    return text if low is None or high is None else f"{text}, stated {low:g}..{high:g} px"


def _alignment_text(alignment: dict[str, Any] | None) -> str:
    if alignment is None:
        return "cannot be estimated: too little texture"
    low, high = alignment["gains"]
    out_of_place = "" if alignment["is_misaligned"] else ", no more than the error of the estimate"
    uneven = "" if alignment["is_uneven"] else ", no more than the error of the estimate"
    return (
        f"views {alignment['misalignment_px']:.3f} px (rms) out of place{out_of_place}; "
        f"exposures differ by {100 * alignment['unevenness']:.2f} % of white (rms; gains "
        f"{low:.3f}..{high:.3f}){uneven}"
    )


def _disparity_text(report: dict[str, Any]) -> str:
    span = report["disparity_px"]
    if span is not None:
        return f"about {span['min_px']:.1f}..{span['max_px']:.1f} px per adjacent view (estimated)"
    why = NOTHING_MATCHES if report["has_texture"] else "too little texture"
    return f"cannot be estimated: {why}"


def _truth_text(truth: dict[str, float] | None) -> str:
    if truth is None:
        return "none"
    text = f"{truth['min_px']:.2f}..{truth['max_px']:.2f} px"
    return text if truth["known"] == 1 else f"{text}, known at {100 * truth['known']:.1f} %"
