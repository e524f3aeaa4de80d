"""The light field: a square grid of views of one scene, with what is known about it.

Conventions (docs/conventions.md): views[row, col] from the top-left viewpoint; pixel (x, y) of
the centre view is seen in view (row, col) at (x - d * (col - c), y - d * (row - c)), where d is
its disparity in pixels per adjacent view; d > 0 is nearer than the focus plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epinet.angular import gather_stacks
from epinet.camera import Camera
from epinet.errors import InputError

LUMA = np.array([0.299, 0.587, 0.114], dtype=np.float32)

FAINT = 0.25
"""Views whose samples reach less of white than this are brightened."""
BRIGHT_PERCENTILE = 99.99
"""Of the centre view's samples: the few above it may be sensor faults."""


@dataclass(frozen=True)
class LightField:
    """Views of one scene and what is known about them.

    Example:
        >>> lf = LightField(np.zeros((9, 9, 64, 48, 3), np.uint8))
        >>> lf.grid, lf.centre, lf.stacks(9).shape
        ((9, 9), (4, 4), (4, 9, 64, 48))
    """

    views: NDArray[Any]
    """(V, U, H, W, C): uint8, uint16 or float32 in 0..1; C = 1 (gray) or 3 (RGB)."""
    present: NDArray[np.bool_] = field(default=None)  # type: ignore[arg-type]
    """(V, U): which views there are; the others are zeros. None means all."""
    camera: Camera | None = None
    truth: NDArray[np.float32] | None = None
    """(H, W) disparity of the centre view in pixels per adjacent view; NaN where unknown."""
    masks: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)
    """(H, W) regions of the centre view by name, e.g. "invalid"."""
    objects: NDArray[np.uint16] | None = None
    """(H, W) number of the object that each pixel of the centre view shows."""
    source: Path | None = None
    """Where it was read from."""
    layout: str = "array"
    """Name of the layout on disk."""
    grid_origin: tuple[int, int] = (0, 0)
    """(row, col) of views[0, 0] in the grid that was read."""
    grid_step: int = 1
    """How many views of the grid that was read lie from one of these to the next."""
    order: tuple[bool, bool, bool] = (False, False, False)
    """flip_rows, flip_cols and transpose by which that grid was put in order; see `reordered`."""
    notes: tuple[str, ...] = ()
    """What a user should know about how it was read."""
    captured: bool = False
    """Taken by a camera, so that views may be out of place and exposed differently."""
    view_truths: Mapping[tuple[int, int], NDArray[np.float32]] = field(default_factory=dict)
    """(H, W) disparity of further views by (row, col), each in its own pixels."""
    row_spacing: float = 1.0
    """Distance of the rows in units of the columns', which is that of disparities."""

    def __post_init__(self) -> None:
        v = self.views
        if v.ndim != 5 or v.shape[-1] not in (1, 3):
            gray = "; give gray ones a last axis: views[..., None]" if v.ndim == 4 else ""
            raise InputError(f"views must have shape (V, U, H, W, 1 or 3), got {v.shape}{gray}")
        if v.dtype not in (np.uint8, np.uint16, np.float32):
            how = "; views.astype(np.float32) is" if v.dtype.kind == "f" else ""
            raise InputError(f"views must be uint8, uint16 or float32 in 0..1, got {v.dtype}{how}")
        if self.present is None:
            object.__setattr__(self, "present", np.ones(v.shape[:2], dtype=bool))
        others = {f"truth of view {position}": t for position, t in self.view_truths.items()}
        images = {"truth": self.truth, "objects": self.objects, **self.masks, **others}
        for name, image in images.items():
            if image is not None and image.shape != v.shape[2:4]:
                raise InputError(
                    f"{name} is {image.shape[1]}x{image.shape[0]} px, "
                    f"the views are {v.shape[3]}x{v.shape[2]} px"
                )

    @property
    def grid(self) -> tuple[int, int]:
        """(rows, columns) of views."""
        return self.views.shape[0], self.views.shape[1]

    @property
    def size(self) -> tuple[int, int]:
        """(height, width) of a view in pixels."""
        return self.views.shape[2], self.views.shape[3]

    @property
    def bits(self) -> int:
        """Bits per sample: 8, 16 or 32 (float)."""
        return 8 * self.views.dtype.itemsize

    @property
    def centre(self) -> tuple[int, int]:
        """(row, col) of the reference view, whose disparity is estimated."""
        return (self.grid[0] - 1) // 2, (self.grid[1] - 1) // 2

    @property
    def reference(self) -> str:
        """The reference view in words."""
        (row, col), (row0, col0) = self.centre, self.grid_origin
        row, col = row0 + self.grid_step * row, col0 + self.grid_step * col
        return f"row {row}, column {col} (counted from 0)"

    @property
    def absence(self) -> str:
        """What is the matter with views that are not `present`, in words.

        A folder lacks their files; an array always has room for them, and holds zeros there.
        """
        in_folder = self.source is None or self.source.is_dir()
        return "missing" if in_folder else "black, 0 throughout, as where nothing was captured"

    def rgb(self, row: int, col: int) -> NDArray[np.float32]:
        """One view as (H, W, 3) in 0..1."""
        view = self.unit(row, col)
        return np.repeat(view, 3, axis=2) if view.shape[2] == 1 else view

    def gray(self, row: int, col: int) -> NDArray[np.float32]:
        """One view as (H, W) luma in 0..1 (.299 R + .587 G + .114 B, as in the reference)."""
        view = self.views[row, col]
        if view.shape[2] == 1:
            return self.unit(row, col)[..., 0]
        # Several times as fast as a product of the unit view with a vector of three.
        gray = np.zeros(view.shape[:2], np.float32)
        for k, share in enumerate(LUMA):
            channel = np.divide(view[..., k], self._white, dtype=np.float32)
            channel *= share
            gray += channel
        return gray

    def unit(self, row: int, col: int) -> NDArray[np.float32]:
        """One view as (H, W, C) in 0..1."""
        view = self.views[row, col]
        if view.dtype == np.float32:
            return np.asarray(view)
        unit: NDArray[np.float32] = view.astype(np.float32) / np.float32(self._white)
        return unit

    @property
    def _white(self) -> float:
        """The largest value of a sample."""
        return 1.0 if self.views.dtype == np.float32 else float(np.iinfo(self.views.dtype).max)

    def stacks(self, views: int, streams: int = 4) -> NDArray[np.float32]:
        """Network input (streams, views, H, W) from a grid of exactly `views` x `views`."""
        if self.grid != (views, views):
            raise InputError(f"expected a {views}x{views} grid, this one is {self._grid_text()}")
        return gather_stacks(self.gray, views, streams)

    def central(self, views: int, step: int = 1) -> LightField:
        """The central `views` x `views` grid, taking every `step`-th view around the reference.

        An even grid first gives up its last row and column, so that it has a centre. Disparity
        is per adjacent view, so truth and baseline grow with `step`. Only the reference view
        keeps its truth.

        Raises:
            InputError: the grid is too small, or no such views can be.
        """
        if views < 1 or views % 2 == 0 or step < 1:
            raise InputError(
                f"{views}x{views} views, every {step}th: the number must be odd, the step positive"
            )
        reach = step * (views // 2)
        row, col = self.centre
        if min(row, col) < reach or row + reach >= self.grid[0] or col + reach >= self.grid[1]:
            stepped = f" at every {step}th view" if step > 1 else ""
            raise InputError(
                f"{self.source or 'light field'}: {views}x{views} views{stepped} are needed, "
                f"the grid has {self._grid_text()}"
            )
        rows = slice(row - reach, row + reach + 1, step)
        cols = slice(col - reach, col + reach + 1, step)
        camera = None if self.camera is None else self.camera.at_every(step)
        row0, col0 = self.grid_origin
        return replace(
            self,
            views=self.views[rows, cols],
            present=self.present[rows, cols],
            truth=None if self.truth is None else self.truth * np.float32(step),
            view_truths={},
            camera=camera,
            grid_origin=(row0 + self.grid_step * rows.start, col0 + self.grid_step * cols.start),
            grid_step=self.grid_step * step,
        )

    @property
    def reliable_truth(self) -> NDArray[np.float32] | None:
        """(H, W) truth, NaN where the mask "invalid" says that the views show something else."""
        if self.truth is None or "invalid" not in self.masks:
            return self.truth
        return np.where(self.masks["invalid"], np.float32(np.nan), self.truth)

    def reordered(
        self, *, flip_rows: bool = False, flip_cols: bool = False, transpose: bool = False
    ) -> LightField:
        """Correct the order of the views: first the transposition, then the flips.

        The images stay as they are; only which view stands where changes. Flipping an even grid
        makes another view the reference, which truth, masks and objects do not belong to: they go.
        Truths of other views go in any case.
        """
        even_rows, even_cols = (side % 2 == 0 for side in self.grid)
        moved = (flip_rows and even_rows) or (flip_cols and even_cols)
        views, present = self.views, self.present
        if transpose:
            views, present = np.swapaxes(views, 0, 1), present.T
        if flip_rows:
            views, present = views[::-1], present[::-1]
        if flip_cols:
            views, present = views[:, ::-1], present[:, ::-1]
        changes = {"transposed": transpose, "rows flipped": flip_rows, "columns flipped": flip_cols}
        made = ", ".join(name for name, done in changes.items() if done)
        notes = self.notes
        if made:
            notes += (f"order of the views corrected ({made}); they are counted in that order",)
        rows, cols, transposed = self.order
        if transpose:
            rows, cols = cols, rows
        order = (rows != flip_rows, cols != flip_cols, transposed != transpose)
        changed = replace(
            self, views=views, present=present, notes=notes, order=order, view_truths={}
        )
        return replace(changed, truth=None, masks={}, objects=None) if moved else changed

    def brightened(self) -> LightField:
        """Views that reach little of white, such as 10-bit samples in 16 bits, made to reach it.

        What measures them, and the networks, know how large noise is in a well exposed picture.
        """
        samples = self.views[self.centre]
        reached = float(np.percentile(samples, BRIGHT_PERCENTILE)) if samples.size else 0.0
        if not 0 < reached < FAINT * self._white:
            return self
        gain = self._white / reached
        scaled = np.empty_like(self.views)
        for place in np.ndindex(self.grid):
            view = (self.views[place] * np.float64(gain)).clip(0, self._white)
            scaled[place] = view if self.bits == 32 else np.round(view)
        percent = f"{100 / gain:.1f}" if gain < 100 else f"{100 / gain:.2g}"
        note = (
            f"samples reach only {percent} % of white, as those of fewer bits do in a file of more "
            f"or of a dark picture; taken {gain:.4g} times as bright"
        )
        return replace(self, views=scaled, notes=(*self.notes, note))

    def _grid_text(self) -> str:
        return f"{self.grid[0]}x{self.grid[1]}"
