"""Rendered scenes obey the geometry: the truth explains every view."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from epinet.synth import faults as camera_faults
from epinet.synth.bank import draw_bank
from epinet.synth.cast import nearest, pixel_rays
from epinet.synth.draw import draw_scenes
from epinet.synth.generator import (
    bank,
    discontinuities,
    draw_scene,
    generator,
    pools,
    render_scene,
    star_offsets,
)
from epinet.synth.options import RANGES_PX, Faults, Options
from epinet.synth.render import Lens, render, truth, visible

MATTE = Options(
    size=(64, 72),
    highlights=0.0,
    reflective=0.0,
    contrast=(0.3, 1.0),
    surfaces=(60, 90),
    faults=Faults.none(),
)
STAR = star_offsets(9)


def warped(views, offsets, disparity):
    """(1, P, C, H, W): each view looked up where the truth says that the centre's points are."""
    height, width = views.shape[-2:]
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    out = []
    for view, (dv, du) in zip(views[0], offsets, strict=True):
        at = torch.stack([x - disparity[0, 0] * du, y - disparity[0, 0] * dv], -1)
        at = 2 * at / torch.tensor([width - 1, height - 1]) - 1
        out.append(F.grid_sample(view[None], at[None], mode="bicubic", align_corners=True))
    return torch.cat(out)[None]


def inside(offsets, disparity):
    height, width = disparity.shape[-2:]
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    kept = []
    for dv, du in offsets:
        xs, ys = x - disparity[0, 0] * du, y - disparity[0, 0] * dv
        kept.append((xs >= 2) & (xs <= width - 3) & (ys >= 2) & (ys <= height - 3))
    return torch.stack(kept)[None]


def residuals(options, seed, index, shift_px=0.0):
    """|warped view - centre view| where the view sees the point and no edge is near."""
    scenes, g = draw_scene(options, seed, index)
    if options.faults == Faults.none():
        views = render(scenes, STAR, Lens(options.samples))
    else:
        pool_lens = Lens(
            options.samples,
            camera_faults.draw_lens_radius(g, 1, options.faults),
            camera_faults.draw_misalignment(g, 1, len(STAR), options.faults),
        )
        views = camera_faults.blurred(g, render(scenes, STAR, pool_lens), options.faults)
        views = camera_faults.photographed(g, views, options.faults).views
    disparity, surface = truth(scenes)
    smooth = ~(F.max_pool2d(discontinuities(surface.float(), surface).float(), 5, 1, 2) > 0)
    seen = visible(scenes, STAR, disparity)
    seen = (F.max_pool2d((~seen).float(), 5, 1, 2) == 0) & inside(STAR, disparity) & smooth
    error = (warped(views, STAR, disparity + shift_px) - views[:, STAR.index((0, 0)), None]).abs()
    return error.mean(2)[seen]


@pytest.mark.parametrize("name", RANGES_PX)
def test_the_truth_carries_every_view_onto_the_centre(name):
    """Bound: between pixels, a bicubic look-up of four rays per pixel errs by .02 at the median."""
    right, shifted = [], []
    for index in range(6):
        options = replace(MATTE, disparity_px=RANGES_PX[name])
        right.append(residuals(options, 3, index))
        shifted.append(residuals(options, 3, index, shift_px=0.3))
    right, shifted = torch.cat(right), torch.cat(shifted)
    assert len(right) > 50_000
    assert right.median() < 0.01
    assert right.mean() < 0.6 * shifted.mean()


def test_the_default_camera_keeps_the_median_residual_small():
    options = Options(size=(64, 72))
    assert torch.cat([residuals(options, 3, k) for k in range(8)]).median() < 0.02


def test_truth_of_other_views_is_the_same_surface():
    """The disparity of view p at x - d du is d, wherever p sees the point."""
    scenes, _ = draw_scene(MATTE, 5, 1)
    disparity, surface = truth(scenes)
    offsets = [(0, 2), (-3, 0), (4, 4)]
    rays = pixel_rays(scenes.size, offsets)
    x, y = rays.x - disparity * rays.du, rays.y - disparity * rays.dv
    moved = replace(rays, x=x, y=y, reach=None)
    there, seen_surface = nearest(scenes, moved)
    seen = visible(scenes, offsets, disparity)
    assert 0.3 < seen.float().mean() < 1
    same = seen & (seen_surface == surface)
    assert same.sum() > 0.98 * seen.sum()
    apart = (there - disparity)[same].abs()
    assert apart.quantile(0.99) < 1e-4
    assert apart.max() < 0.01  # at a quadric's rim a rounding error of eps shows as its root
    assert (there - disparity)[~seen].min() > 0


def test_a_single_scene_is_traced_in_windows_as_in_full():
    scenes, _ = draw_scene(replace(MATTE, clutter=1.0), 7, 0)
    rays = pixel_rays(scenes.size, STAR)
    everywhere = replace(rays, reach=None)
    for part, whole in zip(nearest(scenes, rays), nearest(scenes, everywhere), strict=True):
        assert torch.equal(part, whole)


def test_scenes_of_a_batch_do_not_touch_each_other():
    tiles = draw_bank(generator(1, 0, 0))
    from epinet.synth.draw import draw_scenes

    scenes = draw_scenes(generator(4), 3, MATTE, tiles)
    together = nearest(scenes, replace(pixel_rays(scenes.size, STAR), reach=None))
    for i in range(3):
        alone = nearest(scenes[i : i + 1], pixel_rays(scenes.size, STAR))
        for whole, single in zip(together, alone, strict=True):
            assert torch.equal(whole[i : i + 1], single)


def test_a_scene_depends_on_seed_and_number_alone():
    options = Options(size=(32, 40), samples=1)
    first = render_scene(options, 1, 3, star_only=True)
    render_scene(options, 1, 4, star_only=True)
    again = render_scene(options, 1, 3, star_only=True)
    np.testing.assert_array_equal(first.views, again.views)
    np.testing.assert_array_equal(first.truth, again.truth)
    other = render_scene(options, 2, 3, star_only=True)
    assert not np.array_equal(first.truth, other.truth)


def test_a_scene_is_a_light_field_with_camera_and_masks():
    lf = render_scene(Options(size=(40, 48), samples=1, surfaces=(60, 90)), 1, 0)
    assert lf.grid == (9, 9) and lf.size == (40, 48) and lf.present.all()
    assert set(lf.masks) == {
        "valid", "invalid", "discontinuities", "planes", "smooth_surfaces", "occluded"
    }  # fmt: skip
    assert not (lf.masks["planes"] & lf.masks["smooth_surfaces"]).any()
    assert not (lf.masks["valid"] & lf.masks["invalid"]).any()
    steps = np.abs(np.diff(lf.truth)) > 1
    assert steps.any() and (np.diff(lf.objects.astype(int)) != 0)[steps].mean() > 0.9
    depth = lf.camera.depth_mm(lf.truth)
    assert np.isfinite(depth).all() and (depth > 0).all()
    nearest_px = np.unravel_index(lf.truth.argmax(), lf.truth.shape)
    assert depth[nearest_px] == depth.min()


def test_floors_begin_within_the_picture_and_lean_more():
    """Nothing in front: each scene is a wall and a floor that meet in a line."""
    options = Options(size=(96, 80), surfaces=(0, 1), clutter=0.0)
    steep = {}
    for floors in (0.0, 1.0):
        maps = [
            truth(draw_scene(replace(options, floors=floors), 5, k)[0])[0][0, 0] for k in range(24)
        ]
        steep[floors] = [
            torch.hypot(m.diff(dim=0)[:, 1:], m.diff(dim=1)[1:]).median().item() for m in maps
        ]
        assert all(m.min() >= -4.01 and m.max() <= 4.01 for m in maps)
    assert np.mean(steep[1.0]) > 2 * np.mean(steep[0.0])


def test_the_light_of_near_lamps_falls_off_and_stays_where_it_falls():
    """On a flat surface without texture or shadow; other lamps light all of it alike."""
    spreads = {}
    for near_lamps in (0.0, 1.0):
        options = replace(MATTE, textureless=1.0, surfaces=(0, 1), near_lamps=near_lamps)
        spreads[near_lamps] = []
        for k in range(6):
            scenes, _ = draw_scene(options, 9, k)
            scenes.light.shade_strength.zero_()
            _, surface = truth(scenes)
            flat = surface[~scenes.materials.curved[0, surface.long()]]
            if len(flat):
                seen = render(scenes, [(0, 0)], Lens(samples=1))[0, 0, 0]
                seen = seen[surface[0, 0] == flat.mode().values]
                spreads[near_lamps].append((seen.max() - seen.min()).item())
    assert max(spreads[0.0]) < 1e-3 and np.mean(spreads[1.0]) > 0.02
    moved = torch.cat([residuals(replace(MATTE, near_lamps=1.0), 9, k) for k in range(3)])
    assert moved.median() < 0.01


@pytest.mark.parametrize("bounds", [(-1.0, 1.0), (-4.0, 4.0), (-25.0, 5.0), (2.0, 3.0)])
def test_disparities_keep_to_the_range(bounds):
    options = Options(size=(64, 64), disparity_px=bounds)
    d = torch.cat([truth(draw_scene(options, 2, k)[0])[0].flatten() for k in range(24)])
    length = bounds[1] - bounds[0]
    assert bounds[0] - 0.03 * length < d.min() and d.max() < bounds[1] + 0.03 * length
    assert d.max() - d.min() > 0.9 * length


def test_what_no_first_ray_sees_still_ends_the_others():
    """A box hides the background from all pixel centres, but not from all of the last column."""
    scenes, _ = draw_scene(MATTE, 5, 1)
    boxes, width = scenes.boxes, MATTE.size[1]
    half = torch.tensor([(width - 1) / 2 + 0.05, 100, 0.1])
    exists = torch.zeros_like(boxes.exists)
    exists[0, 0] = True
    boxes.centre[0, 0] = torch.tensor([0, 0, 3.9])
    boxes.matrix[0, 0] = torch.diag(1 / half)
    boxes.bounds[0, 0] = torch.tensor([-half[0], half[0], -half[1], half[1], 4.0])
    groups = {
        name: replace(getattr(scenes, name), exists=getattr(scenes, name).exists & False)
        for name in ("quadrics", "reliefs")
    }
    planes = replace(scenes.planes, exists=scenes.planes.exists & ~scenes.planes.cut)
    scenes = replace(scenes, **groups, planes=planes, boxes=replace(boxes, exists=exists))
    assert (truth(scenes)[1] >= scenes.first_ids[3]).all()
    assert render(scenes, [(0, 0)], Lens(samples=4)).isfinite().all()


def test_rays_of_all_views_meet_a_relief_once():
    scenes = draw_scenes(generator(4), 64, Options(size=(86, 86)), bank(Options(), 1, 0))
    base, waves = scenes.reliefs.coefficients, scenes.reliefs.waves
    steepest = base[..., 1:].norm(dim=-1)
    steepest = steepest + (waves[..., 0] * waves[..., 1:3].norm(dim=-1)).sum(-1)
    assert steepest.max() * math.hypot(4.5, 4.5) < 1


def test_pools_are_reproducible_and_gray_is_luma():
    options = Options(size=(24, 24), samples=1, faults=Faults.none())
    stream = pools(options, 9, 2)
    next(stream)
    second = next(stream)
    jumped = next(pools(options, 9, 2, first=1))
    assert torch.equal(second.views, jumped.views)
    assert torch.equal(second.disparity, jumped.disparity)
    assert second.views.shape == (2, 33, 1, 24, 24)


def test_strengths_of_zero_leave_the_views_alone():
    views = torch.rand(2, 3, 1, 20, 20)
    g = torch.Generator().manual_seed(0)
    assert torch.equal(camera_faults.blurred(g, views, Faults.none()), views)
    photos = camera_faults.photographed(g, views, Faults.none())
    torch.testing.assert_close(photos.views, views)
    assert not photos.deviation.any()
    assert not camera_faults.draw_misalignment(g, 4, 9, Faults.none()).any()
    assert not camera_faults.draw_lens_radius(g, 4, Faults.none()).any()


def test_full_strength_reaches_every_scene_and_seldom_else():
    """Noise of .03 on white; the read noise adds up to a quarter to it."""
    gray = torch.ones(16, 1, 1, 40, 40) * 0.5
    spread = {}
    for full in (True, False):
        faults = replace(Faults.none(), noise=1.0, full=full)
        photos, deviation = camera_faults.photographed(generator(8), gray, faults)
        spread[full] = photos.flatten(1).std(1)
        torch.testing.assert_close(spread[full], deviation.flatten(1).mean(1), rtol=0.1, atol=1e-5)
    expected = camera_faults.NOISE * math.sqrt(0.5)
    assert (spread[True] > 0.9 * expected).all() and (spread[True] < 1.5 * expected).all()
    assert (spread[False] < 0.3 * expected).float().mean() > 0.5


def test_a_window_is_darkened_as_a_part_of_the_picture_is():
    """A lens does not darken every patch that a picture is cut into as it darkens the whole."""
    faults = replace(Faults.none(), vignetting=1.0, full=True)
    views, part = torch.ones(1, 3, 1, 60, 60), torch.ones(1, 3, 1, 20, 20)
    whole = camera_faults.photographed(generator(8), views, faults).views
    window = camera_faults.photographed(generator(8), part, faults, picture_px=60).views
    cuts = whole.unfold(-2, 20, 1).unfold(-2, 20, 1)  # (1, 3, 1, 41, 41, 20, 20)
    differs = (cuts - window[..., None, None, :, :]).abs().amax((0, 1, 2, 5, 6))
    assert (differs < 1e-6).sum() == 1


def test_noise_is_normal_and_the_same_everywhere():
    noise = camera_faults.hashed_normal(torch.Size((200, 1000)), 5, "cpu")
    assert abs(noise.mean()) < 0.01 and abs(noise.std() - 1) < 0.01
    neighbours = (noise[:, 1:] * noise[:, :-1]).mean(), (noise[1:] * noise[:-1]).mean()
    assert max(abs(n) for n in neighbours) < 0.01
    other = camera_faults.hashed_normal(torch.Size((200, 1000)), 6, "cpu")
    assert abs((noise * other).mean()) < 0.01


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU")
def test_a_gpu_makes_the_same_scene():
    options = Options(size=(64, 64))
    here, there = (render_scene(options, 1, 0, device=d, star_only=True) for d in ("cpu", "cuda"))
    differs = np.abs(here.views.astype(int) - there.views).max(-1) > 1
    assert differs[here.present].mean() < 0.01
    edges = here.masks["discontinuities"]
    np.testing.assert_allclose(here.truth[~edges], there.truth[~edges], atol=1e-3)
