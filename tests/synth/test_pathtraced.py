"""Path-traced scenes; what needs Mitsuba is skipped where it is not installed.

EPINET_ASSETS=FOLDER (the downloaded packages) adds a look at every scene.
"""

import importlib.util
import io
import json
import os
import sys
import tarfile
import zipfile
from itertools import combinations
from math import hypot
from pathlib import Path

import numpy as np
import pytest

from epinet.errors import InputError
from epinet.io.hci import read
from epinet.synth.pathtraced import dataset, render
from epinet.synth.pathtraced.__main__ import main
from epinet.synth.pathtraced.assets import Library
from epinet.synth.pathtraced.backend import load_mitsuba
from epinet.synth.pathtraced.elements import (
    MIRROR,
    Ball,
    Box,
    Lamp,
    Model,
    Panel,
    Scene,
    covered,
    paint,
)
from epinet.synth.pathtraced.obj import Part, read_mtl, read_obj
from epinet.synth.pathtraced.pile import pile
from epinet.synth.pathtraced.rig import VIEWS, centre_rig, fitted_rig
from epinet.synth.pathtraced.scenes import SCENES
from epinet.synth.pathtraced.stage import build, resting_parts
from epinet.synth.pathtraced.truth import cast_rays, discontinuities, trace

needs_mitsuba = pytest.mark.skipif(
    importlib.util.find_spec("mitsuba") is None, reason="mitsuba is not installed"
)
SIZE = 48
CENTRE = VIEWS // 2

CUBE = """mtllib brick.mtl
v 0 0 0\nv 2 0 0\nv 2 1 0\nv 0 1 0\nv 0 0 1\nv 2 0 1\nv 2 1 1\nv 0 1 1
vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1
usemtl red
f 1/1 4/2 3/3 2/4\nf 5/1 6/2 7/3 8/4\nf 1/1 2/2 6/3 5/4
usemtl photo
f -1/1 -2/2 -6/3 -5/4\nf 1/1 5/2 8/3 4/4\nf 2/1 3/2 7/3 6/4
"""
MTL = "newmtl red\nKd 0.8 0.1 0.1\nKs 0.5 0.5 0.5\nd 1\nnewmtl photo\nKd 1 1 1\nmap_Kd a b.png\n"


def png(seed: int) -> bytes:
    """A texture of smooth blobs."""
    from PIL import Image

    rng = np.random.default_rng(seed)
    image = Image.fromarray(rng.integers(0, 256, (24, 24, 3), dtype=np.uint8))
    data = io.BytesIO()
    image.resize((192, 192), Image.Resampling.BICUBIC).save(data, "png")
    return data.getvalue()


def archive(files: dict[str, bytes]) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as zipped:
        for name, content in files.items():
            zipped.writestr(name, content)
    return data.getvalue()


def deb(name: str, content: bytes) -> bytes:
    """A Debian package that holds one file."""
    data = io.BytesIO()
    with tarfile.open(fileobj=data, mode="w:xz") as tar:
        member = tarfile.TarInfo(f"./{name}")
        member.size = len(content)
        tar.addfile(member, io.BytesIO(content))
    packed = b"!<arch>\n"
    for part, body in {"debian-binary": b"2.0", "data.tar.xz": data.getvalue()}.items():
        packed += f"{part:<16}{0:<12}{0:<6}{0:<6}{'100644':<8}{len(body):<10}`\n".encode()
        packed += body + b"\n" * (len(body) % 2)
    return packed


@pytest.fixture
def assets(tmp_path):
    """Packages named and built like the real ones, with our own content."""
    folder = tmp_path / "assets"
    folder.mkdir()
    catalogue = b"model#1=/blendswap-cc-0/brick/brick.obj\ncreator#1=Somebody\n"
    models = {
        "PluginFurnitureCatalog.properties": catalogue,
        "blendswap-cc-0/brick/brick.obj": CUBE.encode(),
        "blendswap-cc-0/brick/brick.mtl": MTL.encode(),
        "blendswap-cc-0/brick/a b.png": png(3),
    }
    path = "usr/share/sweethome3d/furniture/BlendSwap-CC-0.sh3f"
    (folder / "sweethome3d-furniture_1.8-1_all.deb").write_bytes(deb(path, archive(models)))
    textures = {"robosuite/models/assets/textures/wall.png": png(1)}
    (folder / "robosuite-1.5.2-py3-none-any.whl").write_bytes(archive(textures))
    photos = {"skimage/data/coffee.png": png(2), "skimage/data/secret.png": png(2)}
    (folder / "scikit_image-0.26.0-cp311.whl").write_bytes(archive(photos))
    return folder


def little_scene() -> Scene:
    """Diffuse things before a textured wall."""
    return Scene(
        "little",
        "",
        (
            Panel(4000, 4000, (0, 0, -400), covered("textures/wall.png", 4)),
            Ball(150, -160, -50, covered("photos/coffee.png", 2), y=-150),
            Model("brick", 260, 170, 80, turn=30, y=-60),
            Lamp(800, 800, (0, 1500, 1500), (0, 0, 0), (3, 3, 3)),
        ),
        eye=(30, 60, 1000),
        target=(0, 0, 0),
        ambient=(0.6, 0.6, 0.6),
        disparity_px=(-1.0, 1.5),
    )


@pytest.fixture
def stage(assets, tmp_path):
    (tmp_path / "models").mkdir()
    library = Library(assets, tmp_path / "cache")
    return build(load_mitsuba(), little_scene(), library, tmp_path / "models")


def fitted(stage, scene, size=SIZE):
    rig = centre_rig(scene, size)
    truth = trace(stage, rig)
    return fitted_rig(rig, truth.depth_mm, scene.disparity_px), truth


def test_positions_follow_the_law_of_the_conventions():
    scene = little_scene()
    depth = np.geomspace(500, 3000, 40)
    rig = fitted_rig(centre_rig(scene, 200), depth, (-2.0, 3.0))
    disparity = rig.camera.disparity_px(depth).astype(float)
    np.testing.assert_allclose([disparity[-1], disparity[0]], [-2, 3], atol=1e-5)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 200, (2, 40))
    points = rig.eye + depth[:, None] * rig.rays(CENTRE, CENTRE, x, y)
    for row, col in ((0, 0), (0, 8), (4, 7), (8, 3)):
        seen = rig.rays(row, col, x - disparity * (col - CENTRE), y - disparity * (row - CENTRE))
        np.testing.assert_allclose(
            rig.position(row, col) + depth[:, None] * seen, points, atol=2e-3
        )
    assert rig.position(4, 8)[0] > rig.eye[0] and rig.position(8, 4)[1] < rig.eye[1]


def test_obj_is_cut_into_triangles_by_material(tmp_path):
    (tmp_path / "brick.obj").write_text(CUBE)
    (tmp_path / "brick.mtl").write_text(MTL)
    parts, materials = read_obj(tmp_path / "brick.obj"), read_mtl(tmp_path / "brick.mtl")
    assert {name: len(part.positions) for name, part in parts.items()} == {"red": 18, "photo": 18}
    assert materials["photo"].texture == "a b.png" and materials["red"].specular == 0.5
    volume = sum(
        np.linalg.det(part.positions.reshape(-1, 3, 3)).sum() / 6 for part in parts.values()
    )
    assert volume == pytest.approx(2.0)  # all faces are there, and face outwards
    np.testing.assert_allclose(np.linalg.norm(parts["red"].normals, axis=1), 1)


def test_a_model_rests_where_it_is_put():
    corners = np.random.default_rng(1).normal(size=(30, 3))
    part = Part(corners, corners, np.zeros((30, 2)))
    model = Model("any", size=300, x=20, z=-40, turn=70, y=55, tip=(30, -80))
    placed = resting_parts(model, {"": part})[""].positions
    assert placed[:, 1].min() == pytest.approx(55)
    middle = (placed.max(axis=0) + placed.min(axis=0)) / 2
    assert middle[[0, 2]] == pytest.approx([20, -40])
    before, after = (np.linalg.norm(c[:1] - c[1:], axis=1) for c in (corners, placed))
    np.testing.assert_allclose(after / before, after[0] / before[0])


def test_things_of_the_pile_keep_apart_and_stand_on_something():
    things = pile(seed=7)
    assert things == pile(seed=7) != pile(seed=8)
    ground = [t for t in things if t.y == 0]
    assert 35 <= len(ground) <= 46

    def reach(thing):
        if isinstance(thing, Box):
            return hypot(thing.size[0], thing.size[2]) / 2
        return thing.radius if isinstance(thing, Ball) else thing.size / 2

    for a, b in combinations(ground, 2):
        assert hypot(a.x - b.x, a.z - b.z) > reach(a) + reach(b) - 1e-6
    boxes = {(t.x, t.z): t.size[1] for t in ground if isinstance(t, Box)}
    assert all(t.y == boxes[t.x, t.z] for t in things if t.y > 0)


def test_assets_come_from_packages_with_their_licences(assets, tmp_path):
    library = Library(assets, tmp_path / "cache")
    assert library.file("models", "brick/brick.mtl").read_text() == MTL
    assert library.file("textures", "wall.png").read_bytes() == png(1)
    library.file("photos", "coffee.png")
    assert library.used["models/brick/brick.mtl"]["licence"] == "CC0-1.0"
    assert library.used["models/brick/brick.mtl"]["author"] == "Somebody"
    assert library.used["textures/wall.png"]["licence"] == "MIT"
    assert "Rachel Michetti" in library.used["photos/coffee.png"]["licence"]
    with pytest.raises(InputError, match="licence"):
        library.file("photos", "secret.png")
    with pytest.raises(InputError, match=r"holds no floor\.png"):
        library.file("textures", "floor.png")


def test_missing_packages_are_named_with_what_to_do(tmp_path, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(InputError) as error:
        Library(tmp_path, tmp_path / "cache")
    assert "robosuite" in str(error.value) and "pip download" in str(error.value)


def test_a_missing_mitsuba_is_told(monkeypatch, capsys, tmp_path):
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    assert main([str(tmp_path / "out")]) == 2
    assert "epinet[render]" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_unknown_scenes_and_bad_settings_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"moon.*still_life"):
        dataset.make_dataset(tmp_path, scenes=["moon"])
    with pytest.raises(InputError, match="even"):
        render.Settings(samples=9)
    assert render.Settings(samples=144).passes == 4
    assert render.Settings(samples=128).passes == 8


def test_discontinuities_are_steps_and_not_slopes():
    y, x = np.mgrid[:20, :20]
    slanted = 0.3 * x + 0.2 * y
    assert not discontinuities(slanted).any()
    stepped = slanted + (x >= 10)
    np.testing.assert_array_equal(discontinuities(stepped), (x >= 7) & (x <= 12))


@needs_mitsuba
def test_mitsubas_own_rays_follow_the_law(stage):
    scene = little_scene()
    rig, truth = fitted(stage, scene)
    disparity = rig.camera.disparity_px(truth.depth_mm)
    mi, rng = stage.mi, np.random.default_rng(0)
    for _ in range(30):
        row, col = rng.integers(0, VIEWS, 2)
        x, y = rng.integers(0, SIZE, 2)
        ray = rig.rays(CENTRE, CENTRE, np.array(float(x)), np.array(float(y)))
        point = rig.eye + truth.depth_mm[y, x] * ray
        seen = [x - disparity[y, x] * (col - CENTRE), y - disparity[y, x] * (row - CENTRE)]
        sensor = mi.load_dict(rig.sensor(mi, int(row), int(col)))
        film = mi.Point2f(*(float((p + 0.5) / SIZE) for p in seen))
        made, _ = sensor.sample_ray(0.0, 0.0, film, mi.Point2f(0.0, 0.0))
        towards = point - rig.position(row, col)
        across = np.cross(np.array(made.d).ravel(), towards / np.linalg.norm(towards))
        assert np.linalg.norm(across) * rig.focal_px < 1e-3  # px


@needs_mitsuba
@pytest.mark.parametrize("variant", ["scalar_rgb", None])
def test_truth_is_the_surface_at_the_pixels_centres(variant, assets, tmp_path):
    scene = Scene(
        "analytic",
        "",
        (Panel(9000, 9000, (0, 0, -500), paint(0.5, 0.5, 0.5)), Ball(200, 0, 0, MIRROR, y=-200)),
        eye=(0, 0, 1000),
        target=(0, 0, 0),
    )
    stage = build(load_mitsuba(1, variant), scene, Library(assets, tmp_path / "c"), tmp_path)
    rig = centre_rig(scene, SIZE)
    truth = trace(stage, rig)
    y, x = np.mgrid[:SIZE, :SIZE]
    slope = ((x + 0.5 - SIZE / 2) ** 2 + (y + 0.5 - SIZE / 2) ** 2) / rig.focal_px**2
    root = 1 - (1 + slope) * (1 - 0.2**2)  # of |s (ray) - 1000| = 200
    met = root > 0
    expected = np.where(met, 1000 * (1 - np.sqrt(np.maximum(root, 0))) / (1 + slope), 1500)
    np.testing.assert_allclose(truth.depth_mm, expected, rtol=1e-5)
    np.testing.assert_array_equal(truth.objects, np.where(met, 2, 1))
    assert truth.unreliable[met].all() and 0 < truth.unreliable.sum() - met.sum() < 4 * SIZE


@needs_mitsuba
def test_rays_that_meet_nothing_are_infinitely_far(stage):
    away = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -2.0]])
    depth, names = cast_rays(stage, np.array([1500.0, 1500.0, 1000.0]), away)
    assert depth[0] == np.inf and names[0] == ""
    assert depth[1] == pytest.approx(700) and names[1] == "element1part0"


@needs_mitsuba
def test_views_agree_under_the_truth(stage):
    from scipy.ndimage import map_coordinates

    scene = little_scene()
    rig, truth = fitted(stage, scene)
    disparity = rig.camera.disparity_px(truth.depth_mm).astype(float)
    settings = render.Settings(SIZE, 32)
    views = {
        p: render.render_view(stage, scene, rig, settings, *p)[0].astype(float).mean(axis=2)
        for p in ((4, 4), (4, 0), (0, 4), (8, 8))
    }
    y, x = np.mgrid[:SIZE, :SIZE]
    smooth = ~discontinuities(disparity)
    smooth[:8], smooth[-8:], smooth[:, :8], smooth[:, -8:] = False, False, False, False
    for (row, col), view in views.items():
        errors = []
        for sign in (1, -1):
            at = [y - sign * disparity * (row - 4), x - sign * disparity * (col - 4)]
            warped = map_coordinates(view, at, order=1, mode="nearest")
            errors.append(np.abs(warped - views[4, 4])[smooth].mean())
        assert (row, col) == (4, 4) or errors[0] < 0.35 * errors[1]


@needs_mitsuba
def test_an_interrupted_dataset_goes_on_at_the_view(assets, tmp_path, monkeypatch):
    monkeypatch.setattr(dataset, "SCENES", {"little": little_scene})
    settings = render.Settings(32, 2)
    original, calls = render.render_view, []

    def counted(*args):
        calls.append(args[-2:])
        if len(calls) == 5:
            raise KeyboardInterrupt
        return original(*args)

    monkeypatch.setattr(render, "render_view", counted)
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        dataset.make_dataset(out, settings=settings, assets=assets)
    assert not (out / "little").exists()
    dataset.make_dataset(out, settings=settings, assets=assets)
    assert len(calls) == 34 and len(set(calls)) == 33
    dataset.make_dataset(out, settings=settings, assets=assets)
    assert len(calls) == 34  # nothing is made twice
    other = tmp_path / "other"
    dataset.make_dataset(other, settings=settings, assets=assets)
    resumed, straight = read(out / "little"), read(other / "little")
    np.testing.assert_array_equal(resumed.views, straight.views)
    assert resumed.present.sum() == 33 and resumed.grid == (9, 9)
    assert resumed.camera == straight.camera
    assert {"invalid", "discontinuities"} <= set(resumed.masks)
    assert resumed.truth.min() == pytest.approx(-1) and resumed.truth.max() == pytest.approx(1.5)
    record = json.loads((out / dataset.RECORD).read_text())["scenes"]["little"]
    assert record["samples"] == 2 and record["noise_rms_8bit"] > 0
    assert record["assets"]["models/brick/a b.png"]["licence"] == "CC0-1.0"
    with pytest.raises(InputError, match="something else"):
        dataset.make_dataset(out, settings=render.Settings(32, 4), assets=assets)


@needs_mitsuba
@pytest.mark.skipif("EPINET_ASSETS" not in os.environ, reason="EPINET_ASSETS is not set")
@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_its_assets_light_and_depth(name, tmp_path):
    scene = SCENES[name]()
    library = Library(Path(os.environ["EPINET_ASSETS"]), tmp_path / "cache")
    stage = build(load_mitsuba(), scene, library, tmp_path)
    rig, truth = fitted(stage, scene, 64)
    assert np.isfinite(truth.depth_mm).all() and len(np.unique(truth.objects)) >= 8
    view, _ = render.render_view(stage, scene, rig, render.Settings(64, 8), CENTRE, CENTRE)
    assert 50 < np.median(view) < 200 and (view == 255).mean() < 0.05
