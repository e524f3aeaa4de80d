"""Every layout gives back the light field that was written in it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from epinet.angular import star_positions
from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io import LAYOUTS, read_light_field, read_pfm, write_light_field
from epinet.io.lftoolbox import write_v73
from epinet.lightfield import LightField

MakeLightField = Callable[..., LightField]

NAMES = {
    "hci": "scene",
    "rows_cols": "scene",
    "numbered": "scene",
    "eslf": "scene.png",
    "hci_hdf5": "scene.h5",
    "lftoolbox": "scene.mat",
    "array": "scene.npz",
}
WITH_FLOATS = ("hci_hdf5", "lftoolbox", "array")


def star_only(lf: LightField) -> LightField:
    present = np.zeros(lf.grid, bool)
    present[tuple(zip(*star_positions(lf.grid[0]), strict=True))] = True
    return replace(lf, present=present, views=lf.views * present[..., None, None, None])


def check(path: Path, original: LightField, layout: str) -> None:
    lf = read_light_field(path)
    assert (lf.layout, lf.source) == (layout, path)
    assert lf.views.dtype == original.views.dtype
    np.testing.assert_array_equal(lf.views, original.views)
    np.testing.assert_array_equal(lf.present, original.present)
    side = original.grid[0]
    assert lf.stacks(side).tobytes() == original.stacks(side).tobytes()


def test_all_layouts_are_tried() -> None:
    assert list(NAMES) == [name for name, layout in LAYOUTS.items() if layout.write is not None]


@pytest.mark.parametrize("layout", NAMES)
@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("star", [False, True])
def test_views(
    tmp_path: Path, make: MakeLightField, layout: str, dtype: str, channels: int, star: bool
) -> None:
    path = tmp_path / NAMES[layout]
    lf = make(9, dtype, channels)
    lf = star_only(lf) if star else lf
    if dtype == "float32" and layout not in WITH_FLOATS:
        with pytest.raises(
            InputError, match=rf"{path.name}: images .* not float views; write .npz"
        ):
            write_light_field(path, lf, layout)
        assert not path.exists()
        return
    write_light_field(path, lf, layout)
    check(path, lf, layout)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("layout", [name for name in NAMES if name != "eslf"])
@pytest.mark.parametrize("side", [3, 5, 7, 11, 17])
def test_other_grids(tmp_path: Path, make: MakeLightField, layout: str, side: int) -> None:
    lf = star_only(make(side))
    write_light_field(tmp_path / NAMES[layout], lf, layout)
    check(tmp_path / NAMES[layout], lf, layout)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("channels", [1, 3])
def test_matlab_v73(tmp_path: Path, make: MakeLightField, dtype: str, channels: int) -> None:
    lf = make(9, dtype, channels)
    write_v73(tmp_path / "scene.mat", lf)
    assert (tmp_path / "scene.mat").read_bytes().startswith(b"MATLAB 7.3 MAT-file")
    check(tmp_path / "scene.mat", lf, "lftoolbox")


def test_npy(tmp_path: Path, make: MakeLightField) -> None:
    write_light_field(tmp_path / "scene.npy", make(), "array")
    check(tmp_path / "scene.npy", make(), "array")


def test_camera_truth_and_masks(tmp_path: Path, make: MakeLightField, camera: Camera) -> None:
    truth = np.linspace(-1, 2, 24 * 30, dtype=np.float32).reshape(24, 30)
    truth[3, 4] = np.nan
    masks = {name: truth > i for i, name in enumerate(("invalid", "valid", "fine_surrounding"))}
    objects = np.arange(truth.size, dtype=np.uint16).reshape(truth.shape)
    lf = replace(make(), camera=camera, truth=truth, masks=masks, objects=objects)
    for layout in ("hci", "hci_hdf5", "array"):
        write_light_field(tmp_path / NAMES[layout], lf, layout)

    scene = read_light_field(tmp_path / "scene")
    assert scene.camera == camera
    np.testing.assert_array_equal(scene.truth, truth)
    assert scene.masks.keys() == masks.keys()
    assert all((scene.masks[name] == mask).all() for name, mask in masks.items())
    np.testing.assert_array_equal(scene.objects, objects)
    depth = read_pfm(tmp_path / "scene" / "gt_depth_lowres.pfm")
    np.testing.assert_allclose(camera.disparity_px(depth), truth, atol=1e-5)

    np.testing.assert_array_equal(read_light_field(tmp_path / "scene.npz").truth, truth)
    hdf5_truth = read_light_field(tmp_path / "scene.h5").truth
    np.testing.assert_allclose(hdf5_truth, truth, atol=1e-5)


def test_what_exists_is_kept_unless_told(tmp_path: Path, make: MakeLightField) -> None:
    write_light_field(tmp_path / "scene", make(), "hci")
    with pytest.raises(InputError, match="already exists"):
        write_light_field(tmp_path / "scene", make(), "numbered")
    write_light_field(tmp_path / "scene", make(), "numbered", overwrite=True)
    check(tmp_path / "scene", make(), "numbered")


def test_a_layout_that_cannot_hold_it(tmp_path: Path, make: MakeLightField) -> None:
    with pytest.raises(InputError, match="9x9"):
        write_light_field(tmp_path / "a.png", make(5), "eslf")
    with pytest.raises(InputError, match=r"\.mat"):
        write_light_field(tmp_path / "a.png", make(), "lftoolbox")
    with pytest.raises(InputError, match="no layout is named x"):
        write_light_field(tmp_path / "a.png", make(), "x")


@pytest.mark.parametrize("layout", NAMES)
def test_a_real_light_field(tmp_path: Path, real: Path, layout: str) -> None:
    lf = read_light_field(real / "lytro_2067")
    lf = replace(lf, views=lf.views[:, :, 100:200, 100:220])
    write_light_field(tmp_path / NAMES[layout], lf, layout)
    check(tmp_path / NAMES[layout], lf, layout)


def test_writing_twice_gives_the_same_bytes(
    tmp_path: Path, make: MakeLightField, camera: Camera
) -> None:
    lf = replace(make(9), captured=True, camera=camera, truth=np.zeros((24, 30), np.float32))
    names = {k: n for k, n in NAMES.items() if not LAYOUTS[k].is_folder} | {"array ": "a.npy"}
    written = []
    for folder in ("first", "second"):
        for layout, name in names.items():
            write_light_field(tmp_path / folder / name, lf, layout.strip())
        write_v73(tmp_path / folder / "v73.mat", lf)
        written.append({f.name: f.read_bytes() for f in (tmp_path / folder).iterdir()})
        time.sleep(2.1)  # zips tell time by two seconds, Matlab's files by one
    assert len(written[0]) == 6
    assert written[0] == written[1]
