"""Layouts of one file: eslf, hci_hdf5, lftoolbox, array."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io

from epinet.errors import InputError
from epinet.inspect.order import check_order
from epinet.io import read_light_field, write_light_field
from epinet.io.images import write_png
from epinet.io.lftoolbox import write_v73
from epinet.lightfield import LightField
from epinet.synth.generator import render_scene
from epinet.synth.options import Faults, Options

MakeLightField = Callable[..., LightField]

RNG = np.random.default_rng(1)


def problem(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        read_light_field(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("name", ["a.png", "a.h5", "a.mat", "a73.mat", "a.npy", "a.npz"])
@pytest.mark.parametrize("kept", [0, 100, 0.5, 0.98])
def test_truncated_files_are_refused(
    tmp_path: Path, make: MakeLightField, name: str, kept: float
) -> None:
    path = tmp_path / name
    if name == "a73.mat":
        write_v73(path, make())
    else:
        layouts = {".png": "eslf", ".h5": "hci_hdf5", ".mat": "lftoolbox"}
        write_light_field(path, make(), layouts.get(path.suffix, "array"))
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept) if kept < 1 else int(kept)])
    problem(path)


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "a.npy", "a.npz"])
def test_grids_that_cannot_be_used(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    for shape, expected in (
        ((9, 8, 24, 30), "square grid"),
        ((2, 2, 24, 30), "at least 3x3"),
        ((3, 3, 22, 30), "too small"),
        ((3, 3, 24), "expected (rows"),
        ((3, 3, 24, 30, 2), "expected (rows"),
    ):
        store(path, np.ones(shape, np.uint8))
        assert expected in problem(path)


@pytest.mark.parametrize("name", ["a.h5", "a.mat", "a.npy", "a.npz"])
def test_types_of_views(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    unit = RNG.random((3, 3, 24, 30, 4))
    for dtype in ("float64", "float32", ">f4"):
        store(path, unit.astype(dtype))
        lf = read_light_field(path)
        assert lf.views.dtype == np.float32
        np.testing.assert_array_equal(lf.views, unit[..., :3].astype(np.float32))
    store(path, (unit * 65535).astype(">u2"))
    np.testing.assert_array_equal(
        read_light_field(path).views, (unit * 65535).astype(np.uint16)[..., :3]
    )
    hole = unit.copy()
    hole[1, 2, 3, 4, 1] = np.nan
    for bad, says in (
        (unit * 255, "if white is 255, views / 255 is right"),
        (unit * 1023, "views / 1023"),
        (unit * 65535, "views / 65535"),
        (unit * 1e9, "bring them to that range"),
        (unit * 2 - 1, r"-1..1, (views + 1) / 2 is right"),
        (unit - 2, "bring them to that range"),
        (hole, "1 values of the float views are not finite"),
        (np.full_like(unit, np.inf), "not finite"),
    ):
        store(path, bad)
        assert says in problem(path)
    for dtype in ("int16", "int64"):
        store(path, np.ones((3, 3, 24, 30), dtype))
        assert "expected uint8, uint16" in problem(path)


def store(path: Path, array: np.ndarray) -> None:
    if path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file["LF"] = array
    elif path.suffix == ".mat":
        scipy.io.savemat(path, {"LF": array})
    elif path.suffix == ".npy":
        np.save(path, array)
    else:
        name = "views" if array.ndim < 4 else "anything"
        np.savez(path, **{name: array, "index": np.arange(3)})


# --- eslf ------------------------------------------------------------------------------------


@pytest.mark.parametrize("short", [(0, 0), (1, 0), (2, 1)])
def test_lenslets_become_views(tmp_path: Path, short: tuple[int, int]) -> None:
    """lf[t, s, v, u] = img[14 v + t, 14 u + s], also a bit short of a multiple of 14."""
    size = (14 * 24 - short[0], 14 * 30 - short[1], 3)
    image = RNG.integers(1, 65536, size, dtype=np.uint16)
    image[::14, ::14] = 0  # the corner view, dark as in a capture
    write_png(tmp_path / "scene_eslf.png", image)
    lf = read_light_field(tmp_path / "scene_eslf.png")
    assert (lf.layout, lf.grid_origin) == ("eslf", (3, 3))
    assert "9x9 around (7, 7)" in lf.notes[0]
    for row, col in ((0, 0), (2, 7), (8, 8)):
        np.testing.assert_array_equal(lf.views[row, col], image[row + 3 :: 14, col + 3 :: 14])


@pytest.mark.parametrize(
    "size", [(512, 512), (14 * 24, 14 * 30), (14 * 24 - 3, 14 * 30), (14 * 24, 14 * 30 + 1)]
)
def test_an_image_of_another_size(tmp_path: Path, size: tuple[int, int]) -> None:
    write_png(tmp_path / "photo.png", np.ones(size, np.uint8))
    assert f"{size[1]}x{size[0]} px; an ESLF image" in problem(tmp_path / "photo.png")


# --- hci_hdf5 --------------------------------------------------------------------------------


@pytest.mark.parametrize("per_view", [False, True])
def test_depth_becomes_disparity(tmp_path: Path, make: MakeLightField, per_view: bool) -> None:
    """dH * focalLength / depth - shift, so nearer is larger; unknown where not positive."""
    depth = np.full((24, 30), 4.0, np.float32)
    depth[0, :3] = 2.0, np.inf, 0.0
    with h5py.File(tmp_path / "scene.h5", "w") as file:
        file["LF"] = make().views
        stack = np.ones((9, 9, 24, 30), np.float32)
        stack[4, 4] = depth
        file["GT_DEPTH"] = stack if per_view else depth
        file.attrs.update({"dH": [0.5], "dV": [0.5], "focalLength": [16.0], "shift": 2.5})
    lf = read_light_field(tmp_path / "scene.h5")
    assert lf.truth is not None
    np.testing.assert_array_equal(lf.truth[0, :3], [1.5, -2.5, np.nan])
    assert (lf.truth[1:] == -0.5).all()
    np.testing.assert_array_equal(lf.views, make().views)  # noise shows no order: as stored


@pytest.mark.parametrize("reversed_in_file", [False, True])
def test_the_images_decide_the_order_of_columns(tmp_path: Path, reversed_in_file: bool) -> None:
    options = Options(
        size=(96, 112), surfaces=(30, 40), contrast=(0.5, 1.0), samples=1, faults=Faults.none()
    )
    scene = render_scene(options, 2, 0)
    stored = scene.reordered(flip_cols=reversed_in_file)
    with h5py.File(tmp_path / "scene.h5", "w") as file:
        file["LF"] = stored.views
    lf = read_light_field(tmp_path / "scene.h5")
    np.testing.assert_array_equal(lf.views, scene.views)
    assert bool(lf.notes) == reversed_in_file
    assert lf.order == (False, False, False)  # every reading finds out anew, and nobody asked


@pytest.mark.parametrize("name", ["a.h5", "a.npy", "a.mat"])
def test_axes_in_another_order_are_named(tmp_path: Path, make: MakeLightField, name: str) -> None:
    path, views = tmp_path / name, make(5).views
    gray = views[..., 0]
    stack = views.reshape(25, 24, 30, 3)
    for array, says in (
        (gray.T, "pixels first; transpose(2, 3, 0, 1), or (3, 2, 1, 0) if all are reversed"),
        (views.transpose(2, 3, 0, 1, 4), "pixels first; transpose(2, 3, 0, 1, 4)"),
        (gray.transpose(2, 3, 0, 1), "pixels first"),
        (stack, "a stack of 25 colour views on one axis; reshape to (5, 5, ...)"),
        (stack[:24], "a stack of 24 colour views on one axis; a square grid has"),
    ):
        store(path, np.ascontiguousarray(array))
        assert says in problem(path)
    for array in (gray, views):
        store(path, array)
        assert read_light_field(path).grid == (5, 5)


@pytest.mark.parametrize("name", ["a.npy", "a.mat"])
def test_reversed_axes_are_named(tmp_path: Path, make: MakeLightField, name: str) -> None:
    store(tmp_path / name, np.ascontiguousarray(make(5).views.T))
    assert "reversed order, (channels, width, height, columns, rows)" in problem(tmp_path / name)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("per_view", [False, True])
def test_an_archive_that_matlab_wrote_is_put_right(
    tmp_path: Path, make: MakeLightField, channels: int, per_view: bool
) -> None:
    views = make(5).views[..., :channels]
    depth = np.random.default_rng(1).uniform(2, 4, (5, 5, 24, 30)).astype(np.float32)
    depth = depth if per_view else depth[2, 2]
    for name, order in (("ours.h5", np.asarray), ("matlab.h5", np.transpose)):
        with h5py.File(tmp_path / name, "w") as file:
            file["LF"] = order(views)
            file["GT_DEPTH"] = order(depth)
            file.attrs.update({"dH": 0.5, "focalLength": 16.0, "shift": 2.5})
    ours, matlab = (read_light_field(tmp_path / name) for name in ("ours.h5", "matlab.h5"))
    np.testing.assert_array_equal(matlab.views, ours.views)
    assert matlab.truth is not None and ours.truth is not None
    np.testing.assert_array_equal(matlab.truth, ours.truth)
    assert "reversed order" in matlab.notes[-1] and not ours.notes


@pytest.mark.parametrize("name", ["a.h5", "v73.mat", "v5.mat"])
def test_a_struct_says_what_lies_in_it(tmp_path: Path, make: MakeLightField, name: str) -> None:
    if name == "v5.mat":
        scipy.io.savemat(tmp_path / name, {"LF": {"data": make(5).views, "rate": 1}})
        assert "LF is a struct array" in problem(tmp_path / name)
        return
    with h5py.File(tmp_path / name, "w") as file:
        file["LF/data"] = make(5).views
    assert "a struct of MATLAB's, of data (5, 5, 24, 30, 3)" in problem(tmp_path / name)


def test_depth_without_attributes_is_left_out(tmp_path: Path, make: MakeLightField) -> None:
    with h5py.File(tmp_path / "scene.h5", "w") as file:
        file["LF"] = make().views
        file["GT_DEPTH"] = np.ones((24, 30))
    lf = read_light_field(tmp_path / "scene.h5")
    assert lf.truth is None
    assert "dH, focalLength and shift" in lf.notes[-1]


@pytest.mark.parametrize("name", ["scene.h5", "scene.mat", "v73.mat"])
def test_files_without_the_views_say_what_they_hold(tmp_path: Path, name: str) -> None:
    if name == "scene.mat":
        scipy.io.savemat(tmp_path / name, {"other": 1})
    else:
        with h5py.File(tmp_path / name, "w") as file:
            file["other"] = 1
    assert "LF; it holds other" in problem(tmp_path / name)


# --- array -----------------------------------------------------------------------------------


def test_an_npz_needs_one_array_of_views(tmp_path: Path) -> None:
    views = np.ones((3, 3, 24, 30), np.uint8)
    np.savez(tmp_path / "a.npz", a=views, b=views)
    assert "a (3, 3, 24, 30), b (3, 3, 24, 30)" in problem(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", views=views, b=views, truth=np.zeros((24, 31)))
    assert "31x24 px" in problem(tmp_path / "a.npz")


def test_what_macos_adds_to_an_archive_is_passed_over(tmp_path: Path, make: MakeLightField) -> None:
    np.savez(tmp_path / "a.npz", anything=make(3).views)
    with zipfile.ZipFile(tmp_path / "a.npz", "a") as archive:
        archive.writestr("__MACOSX/._anything.npy", b"\0\5\x16\7 of macOS")
        archive.writestr("notes.txt", b"by hand")
    np.testing.assert_array_equal(read_light_field(tmp_path / "a.npz").views, make(3).views)


def test_pickled_objects_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}], dtype=object), allow_pickle=True)
    problem(tmp_path / "a.npy")
    (tmp_path / "a.npy").write_bytes(b"something else")
    assert "not a numpy file" in problem(tmp_path / "a.npy")


@pytest.mark.parametrize("name", ["a.npy", "a.h5"])
def test_views_that_are_black_are_not_called_missing(tmp_path: Path, name: str) -> None:
    store(tmp_path / name, np.zeros((3, 3, 24, 30, 3), np.uint8))
    lf = read_light_field(tmp_path / name)
    with pytest.raises(InputError, match="around the centre are black, 0 throughout"):
        check_order(lf)
