"""Commands on a result folder: what they make, what they say, and what they refuse."""

import json
import re
import shutil
import sys
from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh
from PIL import Image

from epinet.camera import Camera
from epinet.cli import main
from epinet.io import read_pfm, write_light_field, write_pfm
from epinet.io.read import read_light_field
from epinet.lightfield import LightField
from epinet.predict.result import Result

CAMERA = Camera(50.0, 36.0, 5.0, 800.0, 48, 40)
NEAR_MM, FAR_MM = 600.0, 1000.0


@dataclass(frozen=True)
class Done:
    """What a command line came to."""

    status: int
    stdout: str
    stderr: str


@pytest.fixture
def run(monkeypatch, capsys):
    """Runs a command line as `python -m epinet` does, but without starting Python anew."""

    def command_line(*arguments):
        monkeypatch.setattr(sys, "argv", ["epinet", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            main()
        return Done(int(end.value.code or 0), *capsys.readouterr())

    return command_line


def files(folder):
    return {p: p.stat().st_mtime_ns for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="session")
def stored(tmp_path_factory):
    """Results of a step between two walls: `metric` has a camera, `bare` has none."""
    folder = tmp_path_factory.mktemp("results")
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 256, (40, 48, 3)).astype(np.uint8)
    views = np.broadcast_to(texture, (3, 3, 40, 48, 3)).copy()
    depth = np.where(np.arange(48) < 24, NEAR_MM, FAR_MM) * np.ones((40, 1))
    confidence = np.ones((40, 48), np.float32)
    confidence[:10] = 0.2
    for name, camera in (("metric", CAMERA), ("bare", None)):
        write_light_field(folder / "views" / name, LightField(views, camera=camera), "hci")
        lf = read_light_field(folder / "views" / name)
        Result(CAMERA.disparity_px(depth), confidence, lf).save(folder / name)
    return folder


def test_from_a_result_to_depth_and_meshes_in_mm(run, stored, tmp_path):
    done = run("depth", stored / "metric", "-o", tmp_path / "depth.pfm")
    assert done.status == 0, done.stderr
    assert "depth 600..1000 mm, 0 px infinitely far" in done.stdout
    depth = read_pfm(tmp_path / "depth.pfm")
    np.testing.assert_allclose(depth[:, [0, 47]], [[NEAR_MM, FAR_MM]] * 40, rtol=1e-5)

    done = run("mesh", stored / "metric", "-o", tmp_path / "mesh.ply")
    assert done.status == 0, done.stderr
    assert "1920 points, 3588 faces" in done.stdout
    mesh = trimesh.load(tmp_path / "mesh.ply", process=False)
    wide = 36 / 50 * FAR_MM * 23 / 48  # from the axis to the outermost pixel's middle
    np.testing.assert_allclose(
        mesh.bounds[1], [wide + 36 / 50 * FAR_MM / 96, 292.5, -600], rtol=1e-4
    )

    done = run("mesh", stored / "metric", "-o", tmp_path / "print.stl", "--size-mm", 60)
    assert done.status == 0, done.stderr
    solid = trimesh.load(tmp_path / "print.stl")
    assert solid.is_volume and solid.extents[0] == pytest.approx(60)


def test_limits_leave_out_what_they_say(run, stored, tmp_path):
    def points(*options):
        done = run("mesh", stored / "metric", "-o", tmp_path / "points.ply", "--points", *options)
        assert done.status == 0, done.stderr
        return len(trimesh.load(tmp_path / "points.ply").vertices)

    assert points("--min-confidence", 0.5) == 30 * 48
    assert points("--far-mm", 800) == points("--near-mm", 800) == 40 * 24


def test_calibrate_gives_the_camera_that_depth_and_mesh_take(run, stored, tmp_path):
    camera = tmp_path / "camera.yaml"
    points = ("--point", f"10,20,{NEAR_MM}", "--point", f"40,20,{FAR_MM}", "--point", "5,5,590")
    done = run("calibrate", stored / "bare", *points, "-o", camera)
    assert done.status == 0, done.stderr
    assert len(re.findall(r"residual [+-]0\.\d+ px", done.stdout)) == 3
    assert "not known from distances: how wide things are" in done.stdout
    (focus,) = re.findall(r"disparity 0 is at (\S+) mm", done.stdout)
    assert float(focus) == pytest.approx(800, rel=0.02)
    depth = run("depth", stored / "bare", "-o", tmp_path / "depth.npz", "--camera", camera)
    assert depth.status == 0, depth.stderr
    found = np.load(tmp_path / "depth.npz")["depth_mm"]
    assert found[20, 40] == pytest.approx(FAR_MM, rel=0.02)
    assert run("mesh", stored / "bare", "-o", tmp_path / "m.glb", "--camera", camera).status == 2
    mesh = run("mesh", stored / "bare", "-o", tmp_path / "m.glb", "--camera", camera, "--fov", 40)
    assert mesh.status == 0, mesh.stderr
    assert f"camera: {camera}, options" in mesh.stdout


def test_baselines_are_of_neighbouring_views_whatever_the_step(run, stored, tmp_path):
    """A result of every second view has twice the disparity; files and options stay the same."""
    views = read_light_field(stored / "views" / "metric")
    camera = replace(CAMERA, baseline_mm=2 * CAMERA.baseline_mm)
    near = camera.disparity_px(np.full((40, 48), NEAR_MM))
    far = camera.disparity_px(np.full((40, 48), FAR_MM))
    disparity = np.where(np.arange(48) < 24, near, far)
    confidence = np.ones((40, 48), np.float32)
    lf = replace(views, camera=camera)
    Result(disparity, confidence, lf, settings={"step": 2}).save(tmp_path / "every_second")
    (tmp_path / "camera.yaml").write_text("baseline_mm: 5\n")
    points = ("--point", f"10,20,{NEAR_MM}", "--point", f"40,20,{FAR_MM}")
    calibrated = tmp_path / "calibrated.yaml"
    done = run("calibrate", tmp_path / "every_second", *points, "-o", calibrated)
    assert done.status == 0, done.stderr
    for given in (
        (),
        ("--camera", stored / "views" / "metric" / "parameters.cfg"),
        ("--camera", tmp_path / "camera.yaml"),
        ("--baseline-mm", 5),
        ("--camera", calibrated),
    ):
        out = tmp_path / "depth.pfm"
        done = run("depth", tmp_path / "every_second", "-o", out, *given)
        assert done.status == 0, done.stderr
        np.testing.assert_allclose(read_pfm(out)[:, [0, 47]], [[NEAR_MM, FAR_MM]] * 40, rtol=1e-3)
    assert "step of 2 views" in done.stdout


def test_a_shape_without_a_camera_says_what_it_assumes(run, stored, tmp_path):
    done = run("mesh", stored / "bare", "-o", tmp_path / "shape.obj", "--not-metric")
    assert done.status == 0, done.stderr
    assert "not metric: made up are a view of 40 degrees" in done.stdout
    assert {p.name for p in tmp_path.iterdir()} == {"shape.obj", "shape.mtl", "shape_texture.png"}


def test_pictures_of_a_result(run, stored, tmp_path):
    for command, options in {
        "refocus": ["--at", "10,10", "-o", "sharp.png"],
        "refocus ": ["--all-in-focus", "-o", "all.jpg"],
        "refocus  ": ["--at", "1,1", "--at", "40,30", "--aperture", "0", "-o", "centre.png"],
        "fade": ["--colour", "black", "-o", "night.png"],
        "wiggle": ["-o", "film.gif", "--disparity", "0"],
    }.items():
        name = options[options.index("-o") + 1]
        options[options.index("-o") + 1] = str(tmp_path / name)
        done = run(command.strip(), stored / "metric", *options)
        assert done.status == 0, done.stderr
        assert f"-> {tmp_path / name}" in done.stdout
        assert Image.open(tmp_path / name).height == 40
    centre = np.asarray(Image.open(stored / "metric" / "centre.png"))
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "centre.png")), centre)


def another_size(folder):
    write_pfm(folder / "metric" / "disparity.pfm", np.zeros((20, 24), np.float32))


def zero_baseline(folder):
    camera = {"fov_deg": 40, "baseline_mm": 0, "focus_distance_mm": 800}
    (folder / "camera.json").write_text(json.dumps(camera))


def other_camera(folder):
    path = folder / "metric" / "run.json"
    told = json.loads(path.read_text())
    told["camera"] |= {"width_px": 512, "height_px": 512}
    path.write_text(json.dumps(told))


def no_views(folder):
    shutil.rmtree(folder / "views")


def nothing(folder):
    pass


BAD = [
    (nothing, "depth bare -o depth.pfm", r"camera is not known.*--focus-mm.*--baseline-mm"),
    (nothing, "depth metric -o depth.exr", r"\.pfm, \.png, \.tif"),
    (nothing, "depth metric -o depth.pfm --step-mm 1", "a step is for 16-bit PNG"),
    (nothing, "depth metric -o depth.pfm --baseline-mm 0", "baseline_mm.*greater than 0"),
    (nothing, "depth views -o depth.pfm", "not a result folder"),
    (nothing, "depth metric -o depth.pfm --camera none.yaml", r"none\.yaml: cannot be read"),
    (other_camera, "depth metric -o depth.pfm", "views of 512x512 px, the disparity map has 48x40"),
    (zero_baseline, "mesh bare -o mesh.glb --camera camera.json", "baseline_mm.*greater than 0"),
    (nothing, "mesh bare -o mesh.glb", r"(?s)camera is not known.*--not-metric"),
    (nothing, "mesh metric -o mesh.fbx", r"\.glb, \.ply, \.obj, \.stl"),
    (nothing, "mesh metric -o mesh.stl --points", "STL holds no points"),
    (nothing, "mesh metric -o mesh.stl --cut-px 1", "cannot be cut"),
    (nothing, "mesh metric -o mesh.glb --size-mm 50", "--size-mm: only for a solid"),
    (nothing, "mesh metric -o mesh.stl --size-mm 0", "size of the print must be more than 0 mm"),
    (nothing, "mesh metric -o mesh.ply --points --faces 50", "points have no faces"),
    (nothing, "mesh metric -o mesh.glb --far-mm 5", "no pixel is left"),
    (nothing, "mesh metric -o mesh.obj --min-confidence 1 --near-mm 1001", "no pixel is left"),
    (another_size, "mesh metric -o mesh.glb", r"centre\.png: 48x40 px, but disparity\.pfm has 24x"),
    (nothing, "calibrate bare -o c.yaml --point 1,2,900", "at least two points"),
    (
        nothing,
        "calibrate bare -o c.yaml --point 5,5,9 --point 40,5,9",
        "all points are at one depth",
    ),
    (
        nothing,
        "calibrate bare -o c.yaml --point 5,5 --point x,5,9",
        r"(?s)--point 5,5.*--point x,5,9",
    ),
    (nothing, "calibrate bare -o c.yaml --point 5,5,900 --point 40,5,600", "smaller disparity"),
    (nothing, "calibrate bare -o c.txt --point 5,5,600 --point 40,5,900", r"ends in \.json"),
    (nothing, "refocus metric -o a.png", "say what is to be sharp"),
    (nothing, "refocus metric -o a.png --at 1,2 --disparity 3", "say what is to be sharp"),
    (nothing, "refocus metric -o a.png --all-in-focus --aperture 1", "nothing is blurred"),
    (nothing, "refocus metric -o a.png --at 100,2", "outside the map"),
    (nothing, "refocus metric -o a.png --at here", "as x,y in whole numbers"),
    (nothing, "refocus metric -o a.gif --at 1,2", r"\.png, \.jpg"),
    (no_views, "refocus metric -o a.png --at 1,2", "views it came from lay at"),
    (no_views, "wiggle metric -o a.gif", "--views PATH"),
    (nothing, "wiggle metric -o a.gif --disparity 40", "no part in common"),
    (nothing, "wiggle metric -o a.avi", r"\.gif or \.mp4"),
    (nothing, "fade metric -o a.png --colour mud", "#rrggbb"),
]


@pytest.mark.parametrize(("damage", "line", "says"), BAD, ids=[case[1] for case in BAD])
def test_bad_input_gets_a_clear_message_and_leaves_nothing(
    run, stored, tmp_path, monkeypatch, damage, line, says
):
    shutil.copytree(stored, tmp_path, dirs_exist_ok=True)
    for path in tmp_path.glob("*/run.json"):
        told = json.loads(path.read_text())
        told["input"] = str(tmp_path / "views" / path.parent.name)
        path.write_text(json.dumps(told))
    damage(tmp_path)
    before = files(tmp_path)
    monkeypatch.chdir(tmp_path)
    done = run(*line.split())
    assert done.status == 2
    assert "error: " in done.stderr
    assert re.search(says, done.stderr), done.stderr
    assert done.stdout == ""
    assert files(tmp_path) == before


def test_what_is_hardly_nearer_than_infinity_is_no_part_of_a_mesh(run, tmp_path):
    """A wall of sky, its disparity off by .02 px here and there, would be kilometres deep."""
    views = np.random.default_rng(0).integers(0, 256, (3, 3, 40, 48, 3)).astype(np.uint8)
    write_light_field(tmp_path / "views", LightField(views, camera=CAMERA), "hci")
    depth = np.where(np.arange(48) < 24, NEAR_MM, np.inf) * np.ones((40, 1))
    disparity = CAMERA.disparity_px(depth)
    disparity[:, 24:] += np.random.default_rng(1).uniform(-0.02, 0.02, (40, 24)).astype("f4")
    lf = read_light_field(tmp_path / "views")
    Result(disparity, np.ones((40, 48), np.float32), lf).save(tmp_path / "result")
    done = run("mesh", tmp_path / "result", "-o", tmp_path / "near.ply")
    assert done.status == 0, done.stderr
    farthest = CAMERA.baseline_focal_mm_px / 0.1
    assert f"farther than {farthest:.4g} mm" in done.stderr and "50.0 %" in done.stderr
    mesh = trimesh.load(tmp_path / "near.ply", process=False)
    assert np.ptp(mesh.vertices, axis=0)[2] < 1
    done = run("mesh", tmp_path / "result", "-o", tmp_path / "all.ply", "--far-mm", "inf")
    assert done.status == 0 and "left out" not in done.stderr
