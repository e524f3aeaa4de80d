"""Files read back by trimesh, and by assimp where it is installed."""

import json
import re
import shutil
import subprocess

import numpy as np
import pytest
import trimesh

from epinet.errors import InputError
from epinet.geometry.surface import surface
from epinet.geometry.surface_files import check_suffix, write_surface


@pytest.fixture(scope="module")
def made(camera, sphere, picture):
    return surface(sphere.disparity, picture, camera)


def read(path):
    return trimesh.load(path, process=False, force="mesh")


def glb_normals(path):
    """Taken from the file itself, by the format's definition."""
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    scene, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
    (primitive,) = scene["meshes"][0]["primitives"]
    accessor = scene["accessors"][primitive["attributes"]["NORMAL"]]
    start = scene["bufferViews"][accessor["bufferView"]].get("byteOffset", 0)
    return np.frombuffer(binary, "<f4", 3 * accessor["count"], start).reshape(-1, 3)


def assert_outward(made, normals):
    """On the sphere they point away from its middle, on the wall towards the camera."""
    outward = made.points_mm - [40.0, -25.0, -700.0]
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    on_wall = made.points_mm[:, 2] < -1100
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-4)
    cosines = (normals * np.where(on_wall[:, None], [0, 0, 1], outward)).sum(axis=1)
    assert np.degrees(np.arccos(np.percentile(np.minimum(cosines, 1), 5))) < 3


def test_glb_is_in_metres_with_normals_and_the_picture(made, picture, tmp_path):
    assert write_surface(tmp_path / "sphere.glb", made) == [tmp_path / "sphere.glb"]
    mesh = read(tmp_path / "sphere.glb")
    np.testing.assert_allclose(mesh.vertices, made.points_mm / 1000, atol=1e-6)
    np.testing.assert_array_equal(mesh.faces, made.faces)
    stored = glb_normals(tmp_path / "sphere.glb")
    assert_outward(made, stored)
    np.testing.assert_allclose(mesh.visual.uv, made.uv, atol=1e-6)
    material = mesh.visual.material
    np.testing.assert_array_equal(np.asarray(material.baseColorTexture)[..., :3], picture)
    assert (material.metallicFactor, material.doubleSided) == (0, True)


def test_ply_is_in_mm_with_normals_and_colours(made, tmp_path):
    write_surface(tmp_path / "sphere.ply", made)
    mesh = read(tmp_path / "sphere.ply")
    np.testing.assert_allclose(mesh.vertices, made.points_mm, rtol=1e-6)
    np.testing.assert_array_equal(mesh.faces, made.faces)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], made.colours)
    data = (tmp_path / "sphere.ply").read_bytes()
    head, rows = data.split(b"end_header\n", 1)
    names = re.findall(rb"property (float|uchar) (\w+)", head)
    kinds = {b"float": "<f4", b"uchar": "u1"}
    layout = np.dtype([(name.decode(), kinds[kind]) for kind, name in names])
    points = np.frombuffer(rows, layout, len(made.points_mm))
    assert_outward(made, np.stack([points[n] for n in ("nx", "ny", "nz")], axis=1))


def test_obj_is_in_mm_with_its_picture_beside_it(made, picture, tmp_path):
    files = write_surface(tmp_path / "my sphere.obj", made)
    assert {f.name for f in files} == {"my sphere.obj", "my_sphere.mtl", "my_sphere_texture.png"}
    assert {f.name for f in tmp_path.iterdir()} == {f.name for f in files}
    mesh = read(tmp_path / "my sphere.obj")
    np.testing.assert_allclose(mesh.bounds, [made.points_mm.min(0), made.points_mm.max(0)])
    assert len(mesh.faces) == len(made.faces)
    np.testing.assert_array_equal(np.asarray(mesh.visual.material.image), picture)
    # The same texture at the same place: readers may number the points anew.
    corners = mesh.vertices[mesh.faces[100]], made.points_mm[made.faces[100]]
    np.testing.assert_allclose(*corners, atol=1e-6)
    np.testing.assert_allclose(mesh.visual.uv[mesh.faces[100]], made.uv[made.faces[100]], atol=1e-6)
    assert "Kd 1.0" in (tmp_path / "my_sphere.mtl").read_text()  # the texture as bright as it is


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj"])
def test_points_alone_keep_their_colours(made, tmp_path, suffix):
    points = made.as_points()
    assert write_surface(tmp_path / f"points{suffix}", points) == [tmp_path / f"points{suffix}"]
    cloud = trimesh.load(tmp_path / f"points{suffix}")
    if suffix == ".glb":
        (cloud,) = cloud.geometry.values()
    assert isinstance(cloud, trimesh.PointCloud)
    unit_mm = 1000 if suffix == ".glb" else 1
    np.testing.assert_allclose(cloud.vertices * unit_mm, made.points_mm, rtol=1e-5, atol=1e-3)
    colours = cloud.colors[:, :3].astype(int)
    if suffix == ".glb":  # glTF's are linear light: middle gray, sRGB 188, is 128
        srgb = made.colours / 255
        light = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
        np.testing.assert_allclose(colours / 255, light, atol=1 / 255)
    else:
        np.testing.assert_allclose(colours, made.colours, atol=1)


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj"])
def test_assimp_reads_the_same(made, tmp_path, suffix):
    assimp = shutil.which("assimp")
    if assimp is None:
        pytest.skip("assimp is not installed")
    path = tmp_path / f"sphere{suffix}"
    write_surface(path, made)
    told = subprocess.run([assimp, "info", path], capture_output=True, text=True, check=True).stdout
    (faces,) = re.findall(r"^Faces:\s+(\d+)", told, re.M)
    assert int(faces) == len(made.faces)
    corner = re.findall(r"^Minimum point\s+\((.*)\)", told, re.M)[0]
    unit_mm = 1000 if suffix == ".glb" else 1
    found = np.array(corner.split(), float) * unit_mm
    np.testing.assert_allclose(found, made.points_mm.min(axis=0), atol=0.01)


def test_what_cannot_be_written_is_refused(made, tmp_path):
    with pytest.raises(InputError, match=r"\.glb, \.ply, \.obj, \.stl"):
        check_suffix(tmp_path / "sphere.fbx", points_only=False)
    with pytest.raises(InputError, match="STL holds no points"):
        check_suffix(tmp_path / "sphere.stl", points_only=True)
    with pytest.raises(InputError, match="cannot be written"):
        write_surface("/proc/no/sphere.obj", made)
