from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from epinet.errors import InputError
from epinet.io import read_pfm, write_pfm

BITS = hnp.arrays(
    np.uint32,
    st.one_of(
        st.tuples(st.integers(1, 5), st.integers(1, 5)),
        st.tuples(st.integers(1, 4), st.integers(1, 4), st.just(3)),
    ),
    elements=st.integers(0, 2**32 - 1),
)
VALUES = np.array([[1.5, -2.0, 3.25], [0.0, 5.0, -6.0]], np.float32)


def stored(header: bytes, rows: np.ndarray = VALUES, order: str = "<") -> bytes:
    return header + rows[::-1].astype(f"{order}f4").tobytes()


@given(bits=BITS, big_endian=st.booleans())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_any_bits_come_back(tmp_path: Path, bits: np.ndarray, big_endian: bool) -> None:
    """Also the payloads of NaN, and values that look like line ends of the header."""
    path = tmp_path / "map.pfm"
    write_pfm(path, bits.view(np.float32), big_endian=big_endian)
    np.testing.assert_array_equal(read_pfm(path).view(np.uint32), bits)


def test_the_benchmark_form(tmp_path: Path) -> None:
    """Bottom row first, little-endian with a negative scale."""
    write_pfm(tmp_path / "map.pfm", VALUES)
    assert (tmp_path / "map.pfm").read_bytes() == stored(b"Pf\n3 2\n-1.0\n")
    assert [file.name for file in tmp_path.iterdir()] == ["map.pfm"]


@pytest.mark.parametrize(
    "header",
    [
        b"Pf\n3 2\n-1\n",
        b"Pf\r\n3 2\r\n-1.000000\r\n",
        b"Pf\r3 2\r-1\r",
        b"Pf 3 2 -1\n",
        b"Pf\n# made by hand\n3 2\n#again\n-1.0 \n",
        b"Pf\n3\n2\n-1e0 # scale\r\n",
    ],
)
@pytest.mark.parametrize("first_bytes", [b"\n\n\n\n", b"\r\n\r\n", b"\n\r  ", b"# a\n"])
def test_headers_in_use(tmp_path: Path, header: bytes, first_bytes: bytes) -> None:
    """Nor does data that begins like white space change anything."""
    values = VALUES.copy()
    values[-1, 0] = np.frombuffer(first_bytes, "<f4")[0]
    (tmp_path / "map.pfm").write_bytes(stored(header, values))
    np.testing.assert_array_equal(read_pfm(tmp_path / "map.pfm"), values)


@pytest.mark.parametrize("scale", ["-2.0", "2", "-1e3", "0.003922"])
def test_values_are_multiplied_by_the_scale(tmp_path: Path, scale: str) -> None:
    order = "<" if scale.startswith("-") else ">"
    (tmp_path / "map.pfm").write_bytes(stored(f"Pf\n3 2\n{scale}\n".encode(), VALUES, order))
    expected = VALUES * np.float32(abs(float(scale)))
    np.testing.assert_array_equal(read_pfm(tmp_path / "map.pfm"), expected)


def test_big_endian_and_colour(tmp_path: Path) -> None:
    values = np.arange(18, dtype=np.float32).reshape(2, 3, 3)
    (tmp_path / "map.pfm").write_bytes(stored(b"PF\n3 2\n1\n", values, ">"))
    np.testing.assert_array_equal(read_pfm(tmp_path / "map.pfm"), values)


@pytest.mark.parametrize(
    ("data", "problem"),
    [
        (b"", "not a PFM"),
        (b"P5\n3 2\n255\n", "not a PFM"),
        (b"Pf\n3 2", "not a PFM"),
        (b"Pf\n3 2\n", "not a PFM"),
        (stored(b"Pf\n3 3\n-1\n"), "36 bytes"),
        (stored(b"Pf\n2 2\n-1\n"), "16 bytes"),
        (stored(b"PF\n3 2\n-1\n"), "72 bytes"),
        (stored(b"Pf\n3 2\n-1\n")[:-1], "incomplete"),
        (stored(b"Pf\n3 2\n-1\n") + b"\0", "damaged"),
        (stored(b"Pf\n1000000000 1000000000\n-1\n"), "1000000000x1000000000"),
        (stored(b"Pf\n0 2\n-1\n"), "positive"),
        (stored(b"Pf\n3 -2\n-1\n"), "positive"),
        (stored(b"Pf\n3 2.5\n-1\n"), "positive"),
        (stored(b"Pf\n3 2\n0\n"), "scale"),
        (stored(b"Pf\n3 2\nnan\n"), "scale"),
        (stored(b"Pf\n3 2\n-inf\n"), "scale"),
        (stored(b"Pf\n3 2\nx\n"), "scale"),
    ],
)
def test_malformed_files_are_refused(tmp_path: Path, data: bytes, problem: str) -> None:
    path = tmp_path / "map.pfm"
    path.write_bytes(data)
    with pytest.raises(InputError, match=problem) as caught:
        read_pfm(path)
    assert str(path) in str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.pfm.*No such file"):
        read_pfm(tmp_path / "none.pfm")


@pytest.mark.parametrize("shape", [(3,), (2, 3, 2), (0, 3), (2, 2, 2, 2)])
def test_other_shapes_are_not_written(tmp_path: Path, shape: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="holds"):
        write_pfm(tmp_path / "map.pfm", np.zeros(shape))


def test_real_truth_rewrites_to_the_same_bytes(tmp_path: Path, real: Path) -> None:
    original = real / "antinous" / "gt_disp_lowres.pfm"
    truth = read_pfm(original)
    write_pfm(tmp_path / "map.pfm", truth)
    np.testing.assert_array_equal(read_pfm(tmp_path / "map.pfm"), truth)
    assert (tmp_path / "map.pfm").read_bytes()[-truth.nbytes :] == original.read_bytes()[
        -truth.nbytes :
    ]
