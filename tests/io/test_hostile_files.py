"""Files made to hurt: nothing is followed out of them, waited for or believed beyond its size."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.io.pfm import read_pfm
from epinet.reading import LIMIT_BYTES, set_limit

VIEWS = np.random.default_rng(0).integers(0, 255, (3, 3, 24, 30, 3)).astype(np.uint8)
Make = Callable[[Path], None]


def hdf5(fill: Callable[[Any, Path], object]) -> Make:
    def make(path: Path) -> None:
        with h5py.File(path, "w") as file:
            fill(file, path.parent)

    return make


def external_storage(file: Any, folder: Path) -> None:
    (folder / "secret").write_bytes(b"s" * VIEWS.size)
    file.create_dataset("LF", VIEWS.shape, "u1", external=str(folder / "secret"))


def external_link(file: Any, folder: Path) -> None:
    with h5py.File(folder / "other.h5", "w") as other:
        other["LF"] = VIEWS
    file["LF"] = h5py.ExternalLink(str(folder / "other.h5"), "LF")


def link_through_a_link(file: Any, folder: Path) -> None:
    external_link(file, folder)
    file.move("LF", "away")
    file["LF"] = h5py.SoftLink("/away")


def virtual(file: Any, folder: Path) -> None:
    external_link(file, folder)
    del file["LF"]
    layout = h5py.VirtualLayout(VIEWS.shape, "u1")
    layout[:] = h5py.VirtualSource(str(folder / "other.h5"), "LF", VIEWS.shape)
    file.create_virtual_dataset("LF", layout)


def never_written(file: Any, folder: Path) -> None:
    shape = (9, 9, 10**5, 10**5, 3)
    file.create_dataset("LF", shape, "u1", chunks=(1, 1, 1000, 1000, 3), compression="gzip")


OUTSIDE = {
    "external_storage": (external_storage, "keeps its values in other files"),
    "external_link": (external_link, "is a link, which is not followed"),
    "link_through_a_link": (link_through_a_link, "is a link, which is not followed"),
    "virtual": (virtual, "keeps its values in other files"),
    "never_written": (never_written, "would take .* MB .*--read-limit"),
    "group": (lambda file, folder: file.create_group("LF"), "is a group"),
    "texts": (lambda file, folder: file.create_dataset("LF", data=[b"a"] * 9), "not numbers"),
    "nothing": (
        lambda file, folder: file.create_dataset("LF", data=h5py.Empty("f")),
        "not numbers",
    ),
}


@pytest.mark.parametrize("suffix", [".h5", ".mat"])
@pytest.mark.parametrize("kind", OUTSIDE)
def test_hdf5_never_leaves_its_file(tmp_path: Path, kind: str, suffix: str) -> None:
    fill, says = OUTSIDE[kind]
    hdf5(fill)(tmp_path / f"a{suffix}")
    with pytest.raises(InputError, match=says):
        read_light_field(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("name", ["depth", "attribute", "overflow"])
def test_truth_of_hdf5_is_numbers(tmp_path: Path, name: str) -> None:
    depth: Any = np.full((24, 30), 1e-300 if name == "overflow" else 1)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["LF"] = VIEWS
        file["GT_DEPTH"] = np.full((24, 30), b"a") if name == "depth" else depth
        file.attrs["dH"] = "wide" if name == "attribute" else 1e300
        file.attrs["focalLength"] = 1e300
        file.attrs["shift"] = 1
    with pytest.raises(InputError, match=r"GT_DEPTH holds|attribute dH|infinite values"):
        read_light_field(tmp_path / "a.h5")


@pytest.mark.parametrize(
    "truth", [np.full((24, 30), None), np.full((24, 30), "a"), np.zeros((24, 30, 2))]
)
def test_truth_of_npz_is_numbers(tmp_path: Path, truth: Any) -> None:
    np.savez(tmp_path / "a.npz", views=VIEWS, truth=truth)
    with pytest.raises(InputError, match="truth"):
        read_light_field(tmp_path / "a.npz")


def test_other_arrays_of_an_npz_are_left_alone(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", views=VIEWS, names=np.array(["a"]), more=np.array([None]))
    np.testing.assert_array_equal(read_light_field(tmp_path / "a.npz").views, VIEWS)


def test_npy_by_columns_and_of_another_byte_order_are_read(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.asfortranarray(VIEWS.astype(">u2")))
    np.testing.assert_array_equal(read_light_field(tmp_path / "a.npy").views, VIEWS)


def header_of(shape: tuple[int, ...]) -> bytes:
    data = io.BytesIO()
    about = {"descr": "|u1", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(data, about)
    return data.getvalue()


def test_a_header_is_not_believed_beyond_the_file(tmp_path: Path) -> None:
    header = header_of((9, 9, 10**5, 10**5, 3))
    (tmp_path / "a.npy").write_bytes(header)
    with pytest.raises(InputError, match=r"2430000000000 bytes, but 0 follow"):
        read_light_field(tmp_path / "a.npy")
    os.truncate(tmp_path / "a.npy", len(header) + 9 * 9 * 3 * 10**10)  # all of it a hole
    with pytest.raises(InputError, match=r"would take 2430000 MB .*--read-limit 2430000"):
        read_light_field(tmp_path / "a.npy")
    (tmp_path / "a.pfm").write_bytes(b"Pf\n1000000 1000000\n-1\n")
    with pytest.raises(InputError, match="1000000x1000000 px, 4000000000000 bytes"):
        read_pfm(tmp_path / "a.pfm")


def compressed(path: Path) -> None:
    """Views that are all 1, 6.75 MB, in little of a file."""
    views = np.ones((3, 3, 500, 500, 3), np.uint8)
    if path.suffix == ".npz":
        np.savez_compressed(path, views=views)
    elif path.suffix == ".mat":
        savemat(path, {"LF": views}, do_compression=True)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file.create_dataset("LF", data=views, compression="gzip")
    else:
        Image.new("L", (2700, 2500)).save(path)


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5", ".png"])
def test_the_limit_says_its_flag_and_can_be_moved(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    compressed(path)
    try:
        set_limit(1)
        with pytest.raises(InputError, match=r"would take 7 MB .*--read-limit 7 COMMAND"):
            read_light_field(path)
        set_limit(7)
        if suffix == ".png":
            with pytest.raises(InputError, match="ESLF"):
                read_light_field(path)
        else:
            assert read_light_field(path).size == (500, 500)
    finally:
        set_limit(LIMIT_BYTES // 10**6)


def test_small_images_do_not_make_a_large_light_field(tmp_path: Path) -> None:
    flat = Image.new("RGB", (4000, 4000))
    flat.save(tmp_path / "input_Cam000.png")
    for k in range(1, 81):
        os.link(tmp_path / "input_Cam000.png", tmp_path / f"input_Cam{k:03d}.png")
    with pytest.raises(InputError, match=r"its images would take .*--read-limit"):
        read_light_field(tmp_path)


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.h5", "a.mat", "a.png", "a.lfp", "a.raw"])
@pytest.mark.parametrize("what", ["fifo", "device"])
def test_what_is_no_regular_file_is_not_waited_for(tmp_path: Path, name: str, what: str) -> None:
    if what == "fifo":
        os.mkfifo(tmp_path / name)
    else:
        (tmp_path / name).symlink_to("/dev/zero")
    with pytest.raises(InputError, match=r"a FIFO, where|a device, where|file is expected"):
        read_light_field(tmp_path / name)


def test_a_fifo_among_views_is_not_waited_for(tmp_path: Path) -> None:
    for k in range(9):
        Image.fromarray(VIEWS[k // 3, k % 3]).save(tmp_path / f"input_Cam{k:03d}.png")
    (tmp_path / "input_Cam004.png").unlink()
    os.mkfifo(tmp_path / "input_Cam004.png")
    with pytest.raises(InputError, match=r"Cam004\.png: a FIFO"):
        read_light_field(tmp_path)
    (tmp_path / "input_Cam004.png").unlink()
    (tmp_path / "input_Cam004.png").symlink_to(tmp_path / "input_Cam003.png")
    os.mkfifo(tmp_path / "parameters.cfg")
    with pytest.raises(InputError, match=r"parameters\.cfg: a FIFO"):
        read_light_field(tmp_path)


def test_a_picture_is_not_what_runs_programs(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 30 30\n")
    with pytest.raises(InputError, match="not an image"):
        read_light_field(tmp_path / "a.png")
