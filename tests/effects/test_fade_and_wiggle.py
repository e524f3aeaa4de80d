"""Fading by distance, and films read back by other readers."""

import sys

import cv2
import numpy as np
import pytest
from PIL import Image

from epinet.effects.fade import fade
from epinet.effects.picture_files import SUFFIXES, check_suffix, write_picture
from epinet.effects.wiggle import wiggle_frames, write_film
from epinet.errors import InputError
from epinet.lightfield import LightField


def test_near_stays_far_goes_and_between_is_half_the_light():
    picture = np.full((1, 3, 3), (200, 100, 0), np.uint8)
    disparity = np.array([[1.0, 0.0, -1.0]], np.float32)
    found = fade(picture, disparity, (0, 0, 0), near_px=1.0, far_px=-1.0)
    assert found[0, 0].tolist() == [200, 100, 0]
    assert found[0, 2].tolist() == [0, 0, 0]
    half = 255 * (1.055 * (((200 / 255 + 0.055) / 1.055) ** 2.4 / 2) ** (1 / 2.4) - 0.055)
    assert abs(found[0, 1, 0] - half) <= 0.5


def test_by_default_the_range_of_the_scene_fades_to_white():
    disparity = np.linspace(-2, 3, 10_000, dtype=np.float32).reshape(100, 100)
    found = fade(np.zeros((100, 100, 3), np.uint8), disparity)
    gray = found[..., 0].ravel().astype(int)
    assert (np.diff(gray) <= 0).all()
    assert (gray[:100] == 255).all() and (gray[-99:] == 0).all()


@pytest.mark.parametrize("d0", [-1.5, 0.8])
def test_what_is_held_still_stands_still(views_of, d0):
    frames = wiggle_frames(views_of(d0), d0)
    assert len(frames) == 12  # 7 there, 5 back: the ends are shown once
    inner = [f[3:-3, 5:-5].astype(int) for f in frames]
    assert max(np.abs(f - inner[0]).max() for f in inner) <= 6
    moving = wiggle_frames(views_of(d0), d0 + 1)
    assert np.abs(moving[0].astype(int) - moving[6].astype(int)).max() > 50


def test_the_margins_that_not_all_views_show_are_cut(views_of):
    lf = views_of(0.0)
    frames = wiggle_frames(LightField(np.full_like(lf.views, 200)), 1.5)
    assert frames[0].shape == (48, 64 - 2 * 5, 3)
    assert all((f == 200).all() for f in frames)


def test_films_come_back(views_of, tmp_path):
    frames = wiggle_frames(views_of(0.5), 0.5)
    write_film(tmp_path / "film.gif", frames, 10)
    gif = Image.open(tmp_path / "film.gif")
    assert (gif.n_frames, gif.info["loop"], gif.info["duration"]) == (12, 0, 100)
    assert gif.size == frames[0].shape[1::-1]
    write_film(tmp_path / "film.mp4", frames, 10)
    film = cv2.VideoCapture(str(tmp_path / "film.mp4"))
    assert film.get(cv2.CAP_PROP_FPS) == 10
    read = []
    while (frame := film.read())[0]:
        read.append(frame[1][..., ::-1])
    assert len(read) == 12
    height, width = read[0].shape[:2]
    assert np.abs(read[3].astype(int) - frames[3][:height, :width]).mean() < 12


def test_mp4_without_opencv_is_refused_and_leaves_nothing(views_of, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    with pytest.raises(InputError, match=r"film\.mp4: MP4 is written by OpenCV.*pip install"):
        write_film(tmp_path / "film.mp4", wiggle_frames(views_of(0.5), 0.5), 10)
    assert not list(tmp_path.iterdir())


def test_a_wiggle_needs_views_with_a_part_in_common(views_of):
    lf = views_of(0.0)
    with pytest.raises(InputError, match="no part in common"):
        wiggle_frames(lf, 30.0)
    with pytest.raises(InputError, match="two views or more"):
        wiggle_frames(LightField(lf.views[:, :1]), 0.0)
    with pytest.raises(InputError, match=r"\.gif or \.mp4"):
        write_film("film.avi", [], 10)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_pictures_come_back(views_of, tmp_path, suffix):
    picture = views_of(0.0).views[3, 3]
    write_picture(tmp_path / f"picture{suffix}", picture)
    read = np.asarray(Image.open(tmp_path / f"picture{suffix}").convert("RGB"))
    lossless = suffix in (".png", ".tif", ".tiff")
    assert np.abs(read.astype(int) - picture).mean() <= (0 if lossless else 8)


def test_other_endings_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"\.png, \.jpg"):
        check_suffix(tmp_path / "picture.exr")
