"""Layouts of one image per view: hci, rows_cols, numbered."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import gaussian_filter

from epinet.angular import star_positions
from epinet.camera import Camera
from epinet.errors import InputError
from epinet.io import read_light_field, write_light_field, write_pfm
from epinet.io.images import read_image, write_png
from epinet.lightfield import LightField

MakeLightField = Callable[..., LightField]


@pytest.fixture
def scene(tmp_path: Path, make: MakeLightField) -> Path:
    """A complete hci folder without parameters.cfg."""
    write_light_field(tmp_path / "scene", make(), "hci")
    (tmp_path / "scene" / "parameters.cfg").unlink()
    return tmp_path / "scene"


def view(scene: Path, row: int, col: int) -> Path:
    return scene / f"input_Cam{9 * row + col:03d}.png"


def keep(scene: Path, positions: list[tuple[int, int]]) -> None:
    kept = {view(scene, row, col) for row, col in positions}
    for file in set(scene.glob("*.png")) - kept:
        file.unlink()


def named(folder: Path, lf: LightField, pattern: str, first: int = 0) -> Path:
    """Rows r, columns c and numbers i; with p for letters as signs, w for words, h for halves."""
    folder.mkdir()
    for row, col in np.ndindex(lf.grid):
        given: dict[str, object] = {"x": row * -1.25}
        numbers = {"r": row + first, "c": col + first, "i": lf.grid[1] * row + col + first}
        for key, n in numbers.items():
            word = "minus" if n < 0 else "Plus" if n else ""
            given |= {key: n, f"{key}p": f"{'m' if n < 0 else 'p'}{abs(n)}"}
            given |= {f"{key}w": f"{word}{abs(n):02d}", f"{key}h": n / 2}
        write_png(folder / pattern.format(**given), lf.views[row, col])
    return folder


def problems(path: Path, layout: str | None = None) -> list[str]:
    with pytest.raises(InputError) as caught:
        read_light_field(path, layout)
    return caught.value.problems


# --- which views are needed -----------------------------------------------------------------


@pytest.mark.parametrize("side", [3, 5, 7, 9])
def test_a_star_inside_the_numbering_of_9x9(scene: Path, make: MakeLightField, side: int) -> None:
    margin = (9 - side) // 2
    keep(scene, [(row + margin, col + margin) for row, col in star_positions(side)])
    lf = read_light_field(scene)
    assert lf.grid == (side, side)
    assert lf.grid_origin == (margin, margin)
    assert lf.present.sum() == 4 * side - 3
    np.testing.assert_array_equal(lf.stacks(side), make().central(side).stacks(side))
    assert lf.notes == ()


def test_every_missing_view_of_the_star_is_named(scene: Path) -> None:
    for row, col in ((4, 4), (2, 2), (0, 8), (1, 2)):
        view(scene, row, col).unlink()
    found = problems(scene)
    assert [line.split(":")[0] for line in found] == [
        str(view(scene, *position)) for position in ((0, 8), (2, 2), (4, 4))
    ]
    assert all("33" in line for line in found)


def test_views_off_the_star_may_be_missing(scene: Path) -> None:
    keep(scene, [*star_positions(9), (2, 3)])
    assert read_light_field(scene).notes == ("1 of the 48 views off the star are there",)


def test_strays_outside_the_star_are_cropped(scene: Path) -> None:
    keep(scene, [(row + 1, col + 1) for row, col in star_positions(7)] + [(0, 1)])
    assert read_light_field(scene).grid == (7, 7)


def test_too_few_views(scene: Path) -> None:
    keep(scene, [(4, 4), (0, 1)])
    assert "at least the central 3x3" in problems(scene)[0]


def test_views_that_differ_are_all_named(scene: Path) -> None:
    write_png(view(scene, 0, 0), np.ones((24, 31, 3), np.uint8))
    write_png(view(scene, 3, 5), np.ones((24, 30, 1), np.uint8))
    write_png(view(scene, 3, 6), np.ones((24, 30, 3), np.uint16))
    found = problems(scene)
    assert len(found) == 3
    assert "input_Cam000.png: 31x24 px 8-bit RGB, the other views are 30x24 px" in found[0]
    assert "8-bit gray" in found[1]
    assert "16-bit RGB" in found[2]


def test_views_that_are_too_small(tmp_path: Path) -> None:
    lf = LightField(np.ones((3, 3, 22, 40, 3), np.uint8))
    write_light_field(tmp_path / "scene", lf, "numbered")
    assert "too small" in problems(tmp_path / "scene")[0]


# --- hci ------------------------------------------------------------------------------------


def test_all_that_is_wrong_is_gathered(scene: Path) -> None:
    view(scene, 0, 0).unlink()
    view(scene, 4, 4).write_bytes(view(scene, 4, 4).read_bytes()[:500])
    (scene / "parameters.cfg").write_text("[intrinsics]\nfocal_length_mm = long\n")
    (scene / "gt_disp_lowres.pfm").write_bytes(b"Pf\n30 24\n-1\n")
    (scene / "invalid_mask.png").write_bytes(b"no image")
    found = "\n".join(problems(scene))
    for part in (
        "input_Cam000.png: missing",
        "input_Cam040.png: cannot be read",
        "focal_length_mm = long",
        "baseline_mm is missing",
        "gt_disp_lowres.pfm: the header says",
        "invalid_mask.png: not an image",
    ):
        assert part in found


@pytest.mark.parametrize(
    ("truth", "problem"),
    [
        (np.zeros((48, 60)), "60x48 px"),
        (np.zeros((24, 30, 3)), "one"),
        (np.full((24, 30), np.nan), "NaN at every pixel"),
        (np.full((24, 30), np.inf), "infinite"),
    ],
)
def test_truth_that_cannot_be_used(scene: Path, truth: np.ndarray, problem: str) -> None:
    write_pfm(scene / "gt_disp_lowres.pfm", truth)
    (found,) = problems(scene)
    assert "gt_disp_lowres.pfm" in found
    assert problem in found


def test_truth_of_other_views_is_ignored(scene: Path) -> None:
    (scene / "gt_disp_lowres_Cam000.pfm").write_bytes(b"anything")
    assert read_light_field(scene).truth is None


def test_objects_by_colour_and_of_another_size(scene: Path) -> None:
    colours = np.zeros((24, 30, 3), np.uint8)
    colours[:, 10:] = 200, 0, 7
    write_png(scene / "objectids_lowres.png", colours)
    objects = read_light_field(scene).objects
    assert objects is not None
    assert len({int(objects[0, 0]), int(objects[0, 10])}) == len(np.unique(objects)) == 2
    write_png(scene / "objectids_lowres.png", colours[1:])
    (found,) = problems(scene)
    assert "objectids_lowres.png: the map of objects is 30x23 px" in found


def test_a_mask_of_another_size(scene: Path) -> None:
    write_png(scene / "mask_fine_lowres.png", np.ones((24, 31), np.uint8))
    (found,) = problems(scene)
    assert "mask_fine_lowres.png: the mask is 31x24 px" in found


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("baseline_mm = 11.0", "baseline_mm = -1", "baseline_mm = -1.0 must be greater"),
        ("focal_length_mm = 100.0", "", "focal_length_mm is missing"),
        ("disp_min = -1.5", "disp_min = low", "disp_min = low must be a number"),
        ("num_cams_x = 9", "num_cams_x = 7", "must be square"),
        ("num_cams_x = 9", "num_cams_x = nine", "must be square"),
        ("image_resolution_x_px = 30", "image_resolution_x_px = 60", "60x24 px"),
        ("[intrinsics]", "intrinsics", "parameters.cfg"),
    ],
)
def test_a_broken_parameters_cfg(
    tmp_path: Path, make: MakeLightField, camera: Camera, old: str, new: str, problem: str
) -> None:
    lf = LightField(make().views, camera=camera)
    write_light_field(tmp_path / "scene", lf, "hci")
    path = tmp_path / "scene" / "parameters.cfg"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    found = "\n".join(problems(tmp_path / "scene"))
    assert problem in found
    assert "parameters.cfg" in found


def test_small_grids_numbered_by_themselves(tmp_path: Path, make: MakeLightField) -> None:
    """By parameters.cfg, or because all of 0 to 24 are there."""
    lf = make(5)
    write_light_field(tmp_path / "scene", lf, "hci")
    np.testing.assert_array_equal(read_light_field(tmp_path / "scene").views, lf.views)
    (tmp_path / "scene" / "parameters.cfg").unlink()
    np.testing.assert_array_equal(read_light_field(tmp_path / "scene").views, lf.views)


def test_more_views_than_a_grid_has(scene: Path) -> None:
    write_png(scene / "input_Cam082.png", np.ones((24, 30, 3), np.uint8))
    assert "83 is no square number" in problems(scene)[0]
    (scene / "parameters.cfg").write_text("[extrinsics]\nnum_cams_x = 9\nnum_cams_y = 9\n")
    assert "the last is input_Cam080" in problems(scene)[0]


def test_two_files_for_one_view(scene: Path) -> None:
    Image.fromarray(read_image(view(scene, 0, 0))).save(scene / "input_Cam000.bmp")
    assert "view 0 is also" in problems(scene)[0]


# --- rows_cols and numbered ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("pattern", "first"),
    [
        ("2067_{r:02d}_{c:02d}.png", 1),
        ("view_{r}_{c}.png", 0),
        ("view-{r:03d}-{c:03d}.png", 1),
        ("Cam_r{r:02d}_c{c:02d}.png", 0),
        ("{i:03d}_{r}_{c}.png", 0),
        ("out_{r:02d}_{c:02d}_{x:.2f}_1010.5_.png", 0),
        ("view_{r:+d}_{c:+d}.png", -5),
        ("view{r:+d}{c:+d}.png", -5),
        ("view_{r}_{c}.png", -5),
        ("{r},{c}.png", -5),
        ("v{rp}_h{cp}.png", -5),
        ("V{rw}-H{cw}.PNG", -5),
        ("cam.{r}.{c}.png", 0),
        ("{r:02d}.{c:02d}.png", 1),
        ("shot2.{r:04d}_{c:04d}.png", 1),
        ("view_{rh:.1f}_{ch:.1f}.png", 0),
        ("cam.{r}.{c}.png", -5),
        ("cam_{r}.{c}.png", -5),
        ("{r}.{c}.png", -5),
        ("view.{r:+d}.{c:+d}.png", -5),
        ("view.{r:+03d}.{c:+03d}.v2.png", -5),
        ("{rp}.{cp}.png", -5),
        ("cam_{rh:.2f}_{ch:.2f}.png", -5),
        ("cam.{rh}.{ch}.png", -5),
    ],
)
def test_rows_and_columns_in_names(
    tmp_path: Path, make: MakeLightField, pattern: str, first: int
) -> None:
    folder = named(tmp_path / "scene", make(11), pattern, first)
    lf = read_light_field(folder)
    assert lf.layout == "rows_cols"
    np.testing.assert_array_equal(lf.views, make(11).views)
    given = named(tmp_path / "again", make(11), pattern, first)
    sorted_ = sorted(given.iterdir(), key=lambda file: (read_image(file) != lf.views[5, 5]).any())
    sorted_[0].unlink()
    (found,) = problems(given)
    written = {"{i": "*_5_5.png", "ou": "out_05_05_*_1010.5_.png"}.get(pattern[:2], sorted_[0].name)
    assert found.startswith(f"{given}/{written}: missing")


@pytest.mark.parametrize(
    "pattern",
    ["{i}.png", "img_{i:03d}.png", "7x7 take 2 ({i:02d}).png", "shot2.{i:04d}.png", "CAM{i}.Png"],
)
@pytest.mark.parametrize("first", [0, 1, 1001])
def test_numbers_in_names(tmp_path: Path, make: MakeLightField, pattern: str, first: int) -> None:
    lf = read_light_field(named(tmp_path / "scene", make(5), pattern, first))
    assert lf.layout == "numbered"
    np.testing.assert_array_equal(lf.views, make(5).views)


@pytest.mark.parametrize("step", [2, 10])
def test_every_kth_number(tmp_path: Path, make: MakeLightField, step: int) -> None:
    views = make(5).views
    for name in ("rows", "numbers", "lattice", "hci", "hci_lattice"):
        (tmp_path / name).mkdir()
    for row, col in np.ndindex(5, 5):
        index, sparse = step * (5 * row + col), 18 * row + 2 * col
        for name in (
            f"rows/{step * row}_{step * col + 3}.png",
            f"numbers/{index + 7:04d}.png",
            f"lattice/{sparse:03d}.png",
            f"hci/input_Cam{index:03d}.png",
            f"hci_lattice/input_Cam{sparse:03d}.png",
        ):
            write_png(tmp_path / name, views[row, col])
    for folder in tmp_path.iterdir():
        lf = read_light_field(folder)
        np.testing.assert_array_equal(lf.views, views, folder.name)
        assert (lf.grid_step == 2) == ("lattice" in folder.name)


def test_every_second_view_of_a_scene_has_its_own_unit(
    tmp_path: Path, make: MakeLightField, camera: Camera
) -> None:
    """As the same light field thinned out by `central`."""
    truth = np.linspace(-1, 1, 24 * 30, dtype=np.float32).reshape(24, 30)
    whole = LightField(make().views, camera=camera, truth=truth)
    write_light_field(tmp_path / "scene", whole, "hci")
    for row, col in np.ndindex(9, 9):
        if row % 2 or col % 2:
            view(tmp_path / "scene", row, col).unlink()
    lf, expected = read_light_field(tmp_path / "scene"), whole.central(5, 2)
    np.testing.assert_array_equal(lf.views, expected.views)
    np.testing.assert_array_equal(lf.truth, expected.truth)
    assert (lf.camera, lf.grid_step, lf.reference) == (expected.camera, 2, expected.reference)


@pytest.mark.parametrize("first", [0, 1])
def test_scenes_numbered_from_one(tmp_path: Path, make: MakeLightField, first: int) -> None:
    folder = named(tmp_path / "scene", make(), "input_Cam{i:03d}.png", first)
    np.testing.assert_array_equal(read_light_field(folder).views, make().views)


@pytest.mark.parametrize("name", ["input_Cam{}.png", "{}.png", "view_{}_0.png", "view_0_{}.png"])
def test_indices_are_bounded_by_the_number_of_files(
    tmp_path: Path, make: MakeLightField, name: str
) -> None:
    """A name with a huge number costs neither memory nor time."""
    pattern = {"input_Cam{}.png": "input_Cam{i:03d}.png", "{}.png": "{i}.png"}
    folder = named(tmp_path / "scene", make(5), pattern.get(name, "view_{r}_{c}.png"))
    (folder / "parameters.cfg").write_text("[extrinsics]\nnum_cams_x=99999999\nnum_cams_y=99999999")
    for digits in (8, 200):
        stray = folder / name.format("9" * digits)
        write_png(stray, make(5).views[0, 0])
        begun = time.monotonic()
        assert len(problems(folder)) == 1
        assert time.monotonic() - begun < 2
        stray.unlink()


def test_a_corner_of_the_views_is_never_taken_for_the_grid(
    tmp_path: Path, make: MakeLightField
) -> None:
    folder = named(tmp_path / "scene", make(5), "left_{r}_{c}.png")
    for row, col in np.ndindex(9, 9):
        if max(row, col) > 4:
            write_png(folder / f"right{row}_{col}.png", make().views[row, col])
    (found,) = problems(folder)
    assert "56 images are named like right" in found and "25 like left_0_0.png" in found
    folder = named(tmp_path / "hci", make(3), "input_Cam{i:03d}.png")
    for i in range(9, 25):
        write_png(folder / f"input_Cam_{i:03d}.png", make().views[0, 0])
    (found,) = problems(folder)
    assert "16 like input_Cam_009.png" in found


def test_capitals_and_endings_may_be_mixed(tmp_path: Path, make: MakeLightField) -> None:
    folder = named(tmp_path / "scene", make(5), "view_{r}_{c}.png")
    for i, file in enumerate(sorted(folder.iterdir())):
        if i % 3 == 1:
            file.rename(file.with_name(file.name.upper()))
        elif i % 3 == 2:
            Image.fromarray(read_image(file)).save(file.with_suffix(".tiff"))
            file.unlink()
    np.testing.assert_array_equal(read_light_field(folder).views, make(5).views)


@pytest.mark.parametrize(
    ("shape", "names"),
    [
        ((1, 9), "view_8_{k}.png"),
        ((9, 1), "{k:03d}.png"),
        ((1, 25), "input_Cam{k:03d}.png"),
        ((4, 9), "{k}.png"),
        ((3, 3), "view_8_{k}.png"),
        ((5, 5), "input_Cam{k:03d}.png"),
        ((6, 6), "{k}.png"),
    ],
)
def test_plain_numbers_are_believed_where_images_agree(
    tmp_path: Path, shape: tuple[int, int], names: str
) -> None:
    """A row of cameras is no grid, though its count is a square."""
    rng = np.random.default_rng(4)
    texture = gaussian_filter(rng.random((300, 300)), 1.5)
    texture = (255 * (texture - texture.min()) / np.ptp(texture)).astype(np.uint8)
    (tmp_path / "scene").mkdir()
    for row, col in np.ndindex(shape):
        k = shape[1] * row + col
        near, far = (texture[100 + d * row :, 100 + d * col :][:60, :80] for d in (2, -1))
        picture = np.where(np.hypot(*np.mgrid[-30:30, -40:40]) < 22, near, far)
        write_png(tmp_path / "scene" / names.format(k=k), picture)
    if shape[0] == shape[1]:
        assert read_light_field(tmp_path / "scene").grid == shape
        return
    (found,) = problems(tmp_path / "scene")
    assert f"they fit {shape[0]}x{shape[1]} (rows x columns)" in found


def test_an_even_grid_is_kept_whole(tmp_path: Path, make: MakeLightField) -> None:
    lf = read_light_field(named(tmp_path / "scene", make(4), "{r}_{c}.png"))
    np.testing.assert_array_equal(lf.views, make(4).views)


@pytest.mark.parametrize("step", [0.5, 0.75, 1.25, -2.5, 0.1])
def test_positions_of_cameras_are_read_where_they_are_a_grid(
    tmp_path: Path, make: MakeLightField, step: float
) -> None:
    views = make(3).views
    for row, col in np.ndindex(3, 3):
        y, x = sorted(step * (k + 1) for k in range(3))[row], 100 + col * abs(step)
        write_png(tmp_path / "grid" / f"cam_{y:.2f}_{x:.2f}.png", views[row, col])
        jitter = 0.137 * ((5 * row + 3 * col) % 7)
        write_png(tmp_path / "none" / f"cam_{y + jitter:.3f}_{x:.3f}.png", views[row, col])
    np.testing.assert_array_equal(read_light_field(tmp_path / "grid").views, views)
    (found,) = problems(tmp_path / "none")
    assert "such as cam_" in found  # no grid, or one that is not square
    assert "view_<row>_<column>.png" in found


@pytest.mark.parametrize(
    ("pattern", "missing"),
    [
        ("2067_{r:02d}_{c:02d}.png", "2067_05_05.png"),
        ("v{r}-{c}.png", "v5-5.png"),
        ("img_{i:03d}.png", "img_041.png"),
    ],
)
def test_missing_views_are_named_alike(
    tmp_path: Path, make: MakeLightField, pattern: str, missing: str
) -> None:
    folder = named(tmp_path / "scene", make(), pattern, 1)
    (folder / missing).unlink()
    (found,) = problems(folder)
    assert found.startswith(f"{folder / missing}: missing")


def test_the_star_alone_by_rows_and_columns(tmp_path: Path, make: MakeLightField) -> None:
    folder = named(tmp_path / "scene", make(), "{r}_{c}.png", 1)
    for row, col in set(np.ndindex(9, 9)) - set(star_positions(9)):
        (folder / f"{row + 1}_{col + 1}.png").unlink()
    np.testing.assert_array_equal(read_light_field(folder).stacks(9), make().stacks(9))


def test_other_images_are_noted(tmp_path: Path, make: MakeLightField) -> None:
    folder = named(tmp_path / "scene", make(), "view_{r}_{c}.png")
    write_png(folder / "thumbnail.png", np.ones((5, 5), np.uint8))
    assert "thumbnail.png" in read_light_field(folder).notes[0]


def test_grids_that_are_not_square(tmp_path: Path, make: MakeLightField) -> None:
    folder = named(tmp_path / "scene", make(5), "view_{r}_{c}.png")
    for file in folder.glob("view_4_*"):
        file.unlink()
    assert "4 rows (0 to 3) and 5 columns (0 to 4)" in problems(folder)[0]
    folder = named(tmp_path / "numbered", make(5), "{i}.png")
    (folder / "24.png").unlink()
    assert "0 to 23, 24 views" in problems(folder)[0]


def test_ambiguous_names(tmp_path: Path, make: MakeLightField) -> None:
    folder = named(tmp_path / "scene", make(), "{r}_{c}_{r}.png")
    assert "1 and 2 or 2 and 3" in problems(folder)[0]


def test_names_with_backslashes_tell_of_an_archive(tmp_path: Path, make: MakeLightField) -> None:
    named(tmp_path / "scene", make(3), "lf\\input_Cam{i:03d}.png")
    (found,) = problems(tmp_path / "scene")
    assert "9 names hold a backslash, such as lf\\input_Cam000.png" in found


# --- what is no light field ------------------------------------------------------------------


def test_unknown_paths_say_what_was_found(tmp_path: Path) -> None:
    assert "no such file or folder" in problems(tmp_path / "none")[0]
    assert "the folder is empty" in problems(tmp_path)[0]
    (tmp_path / "notes.txt").touch()
    assert "0 images, 0 folders and 1 other files" in problems(tmp_path)[0]
    assert "rows_cols: folder of images" in problems(tmp_path)[0]
    assert "a .txt file" in problems(tmp_path / "notes.txt")[0]
    for i in range(9):
        (tmp_path / f"{i}.exr").touch()
    (found,) = problems(tmp_path)
    assert "9 of them end in .exr" in found and ".jfif" in found
    (tmp_path / "scene.zip").touch()
    assert "unpack the archive" in problems(tmp_path / "scene.zip")[0]
    for name in ("caldata-B5143909630.tar", "data.C.0", "MOD_0003.RAW"):
        (tmp_path / name).touch()
        (found,) = problems(tmp_path / name)
        assert "give it with --white" in found


@pytest.mark.parametrize("layout", ["hci", "rows_cols", "numbered"])
def test_a_folder_without_views_for_a_named_layout(tmp_path: Path, layout: str) -> None:
    write_png(tmp_path / "photo.png", np.ones((24, 30), np.uint8))
    assert str(tmp_path) in problems(tmp_path, layout)[0]
    assert "is a folder" in problems(tmp_path / "photo.png", layout)[0]


def test_a_named_layout_overrides_the_guess(tmp_path: Path, make: MakeLightField) -> None:
    folder = named(tmp_path / "scene", make(), "{i:03d}_{r}_{c}.png")
    assert read_light_field(folder, "numbered").layout == "numbered"
    assert "is a file" in problems(folder, "array")[0]
    assert "no layout is named x" in problems(folder, "x")[0]


def test_real_folders(real: Path) -> None:
    antinous = read_light_field(real / "antinous")
    assert antinous.present.all()
    assert antinous.truth is not None
    dino = read_light_field(real / "dino")
    assert dino.present.sum() == 33
    assert dino.notes == ()
    kitchen = read_light_field(real / "kitchen")
    assert kitchen.present.sum() == 34
    assert kitchen.camera is not None
    assert kitchen.camera.focus_distance_mm == pytest.approx(2300)
    assert kitchen.masks["invalid"].any()
    lytro = read_light_field(real / "lytro_2067")
    assert (lytro.layout, lytro.grid, lytro.size) == ("rows_cols", (9, 9), (383, 552))


def test_one_missing_of_a_small_grid(tmp_path: Path, make: MakeLightField) -> None:
    """Nothing is numbered above 24, so the grid is 5x5 and not a rest of 9x9."""
    write_light_field(tmp_path / "scene", make(5), "hci")
    (tmp_path / "scene" / "parameters.cfg").unlink(missing_ok=True)
    (tmp_path / "scene" / "input_Cam012.png").unlink()
    (found,) = problems(tmp_path / "scene")
    assert "input_Cam012.png: missing" in found


def test_a_skipped_number_is_named(tmp_path: Path, make: MakeLightField) -> None:
    write_light_field(tmp_path / "shots", make(5), "numbered")
    for index in range(24, 11, -1):
        (tmp_path / "shots" / f"{index:03d}.png").rename(
            tmp_path / "shots" / f"{index + 1:03d}.png"
        )
    (found,) = problems(tmp_path / "shots")
    assert "The 25 images would fill one: 012 skipped" in found


@pytest.mark.parametrize("focus", ["inf", "-2.5"])
def test_parallel_and_diverging_cameras_come_back(
    tmp_path: Path, make: MakeLightField, camera: Camera, focus: str
) -> None:
    lf = LightField(make().views, camera=replace(camera, focus_distance_mm=1000 * float(focus)))
    write_light_field(tmp_path / "scene", lf, "hci")
    assert read_light_field(tmp_path / "scene").camera == lf.camera


def test_files_of_the_system_are_no_views(tmp_path: Path, make: MakeLightField) -> None:
    write_light_field(tmp_path / "shots", make(3), "numbered")
    for name in ("._000.png", ".DS_Store", "Thumbs.db"):
        (tmp_path / "shots" / name).write_bytes(b"no view")
    assert read_light_field(tmp_path / "shots").grid == (3, 3)


@pytest.mark.parametrize("pattern", ["{r}_{c}.png", "{i:02d}.png"])
def test_as_many_images_of_another_kind_as_views(
    tmp_path: Path, make: MakeLightField, pattern: str
) -> None:
    """Depth maps beside the views: which are which cannot be told by number."""
    folder = named(tmp_path / "scene", make(5), "rgb_" + pattern)
    for file in sorted(folder.iterdir()):
        write_png(folder / file.name.replace("rgb", "depth"), np.ones((24, 30, 3), np.uint8))
    assert "25 images named like depth_" in problems(folder)[0]
    assert "as many like rgb_" in problems(folder)[0]
