"""Text files of any editor, and pointers in place of files."""

import codecs
from pathlib import Path

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.io import read_light_field
from epinet.io.camera_file import read_camera
from epinet.io.images import write_png
from epinet.io.parameters import read_parameters
from epinet.io.pfm import read_pfm
from epinet.networks.weights import load_weights
from epinet.raw.container import parse_json
from epinet.texts import decoded

TEXT = "# Küche, 40°\r\n[extrinsics]\r\nnum_cams_x = 5\rnum_cams_y = 5\n"
WAYS = {
    "utf-8": b"",
    "utf-8-sig": b"",
    "utf-16": b"",
    "utf-16-le": b"",
    "utf-16-be": codecs.BOM_UTF16_BE,
    "utf-32": b"",
    "latin-1": b"",
}
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:%s\nsize 1048576\n" % (b"0" * 64)


@pytest.mark.parametrize("encoding", WAYS)
def test_text_is_the_same_in_every_encoding(tmp_path: Path, encoding: str) -> None:
    data = WAYS[encoding] + TEXT.encode(encoding)
    assert decoded(data) == TEXT.replace("\r\n", "\n").replace("\r", "\n")
    (tmp_path / "parameters.cfg").write_bytes(data)
    assert read_parameters(tmp_path / "parameters.cfg").side == 5
    for suffix, text in ((".json", '{"baseline_mm": 5}'), (".yaml", "# °\nbaseline_mm: 5\n")):
        camera = (tmp_path / "camera").with_suffix(suffix)
        camera.write_bytes(WAYS[encoding] + text.encode(encoding))
        assert read_camera(camera).baseline_mm == 5
    assert parse_json(WAYS[encoding] + '{"a": "°"}\r\n\0\0'.encode(encoding), "") == {"a": "°"}


def test_any_bytes_are_some_text() -> None:
    rng = np.random.default_rng(0)
    for begin in (b"", b"\xff\xfe", b"\xfe\xff", b"\xff\xfe\0\0", b"\0a", b"a\0"):
        for length in range(40):
            decoded(begin + rng.bytes(length))


@pytest.mark.parametrize(
    "name",
    [
        "a.npy",
        "a.npz",
        "a.h5",
        "a.mat",
        "a_eslf.png",
        "a.lfp",
        "a.lfr",
        "a.raw",
        "a.pfm",
        "a.cfg",
        "a.json",
        "a.safetensors",
        "folder",
    ],
)
def test_a_pointer_of_git_lfs_is_called_so(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    readers = {".pfm": read_pfm, ".cfg": read_camera, ".json": read_camera}
    read = readers.get(path.suffix, load_weights if "safe" in name else read_light_field)
    if name == "folder":
        path.mkdir()
        for i in range(9):
            write_png(path / f"{i}.png", np.ones((24, 30), np.uint8))
        (path / "4.png").write_bytes(POINTER)
    else:
        path.write_bytes(POINTER)
    with pytest.raises(InputError) as caught:
        read(path)
    (problem,) = caught.value.problems
    assert problem.startswith(str(path)) and "a pointer of Git LFS" in problem
    assert "git lfs pull" in problem
