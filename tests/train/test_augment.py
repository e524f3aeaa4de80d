"""Laws of the augmentations: one by one as in batches, groups, undoing, photo-consistency."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.ndimage import gaussian_filter, map_coordinates

from epinet.synth.generator import generator, pools
from epinet.synth.options import Faults, Options
from epinet.train.augment import (
    AUGMENTATIONS,
    CameraFaults,
    ColourScale,
    Flip,
    Gamma,
    GrayWeights,
    Rotation,
    Scale,
    SignReversal,
    TurnOrFlip,
    ViewShift,
)
from epinet.train.patches import Frames, LightFields, Patches, gray
from epinet.train.recipe_files import load_recipe
from epinet.train.sources import Needs
from tests.train.one_patch import AUGMENTED, Patch

NEEDS = Needs(views=3, shifted=True)
STAR = list(Needs(views=3).offsets)
SHIFTS = tuple(itertools.product((-1, 0, 1), repeat=2))
SIDE = 56


def scenes(seed: int, count: int = 1) -> LightFields:
    """All nine 3x3 stars inside 5x5 views of scenes in colour, and the truth of their centres."""
    options = Options(
        size=(SIDE, SIDE),
        views=5,
        disparity_px=(-2.0, 2.0),
        contrast=(0.5, 1.0),
        textureless=0.0,
        reflective=0.0,
        highlights=0.0,
        surfaces=(30, 40),
        faults=Faults.none(),
        samples=9,
    )
    made = pools(options, seed, count, offsets=NEEDS.offsets, truths=NEEDS.truths, gray=False)
    pool = next(made)
    return LightFields(pool.views, NEEDS.offsets, pool.disparity, pool.valid, NEEDS.truths)


@pytest.fixture(scope="module")
def scene() -> LightFields:
    return scenes(9)


def whole(scene: LightFields) -> Frames:
    """All of a scene, as it is."""
    side = torch.tensor([scene.views.shape[-1]])
    return Frames.upright(torch.zeros_like(side), side, torch.zeros(1, 2, dtype=torch.int64))


def made(scene: LightFields, *steps) -> Patches:
    """All of a scene, changed by augmentations, each with a choice."""
    frames = whole(scene)
    choices = [(a, torch.as_tensor(choice)[None]) for a, choice in steps]
    for augmentation, choice in choices:
        frames = frames if augmentation.photometric else augmentation.apply(frames, choice)
    patches = scene.cut(frames, STAR)
    for augmentation, choice in choices:
        patches = augmentation.apply(patches, choice) if augmentation.photometric else patches
    return patches


def same(a: Patches, b: Patches) -> bool:
    return (
        torch.equal(a.views, b.views)
        and torch.equal(a.disparity, b.disparity)
        and torch.equal(a.usable, b.usable)
    )


def test_a_batch_is_what_its_patches_are_one_by_one():
    """Whatever combination of choices, places and scenes; scenes wider than high, half usable."""
    many = scenes(12, count=3)
    half = torch.rand(many.usable.shape, generator=generator(5)) < 0.5
    many = LightFields(
        *(many.views[..., :50, :], many.offsets, many.disparity[..., :50, :]),
        *(half[..., :50, :], many.truths),
    )
    many = replace(many, **{f: getattr(many, f).contiguous() for f in ("views", "disparity")})
    many = replace(many, usable=many.usable.contiguous())
    g, count, seen = generator(4), 40, 11
    augmentations = [a for name, a in AUGMENTATIONS.items() if name in AUGMENTED]
    choices = {a.name: a.draw(g, count) for a in augmentations}
    side = seen * choices["scale"]
    scene = torch.randint(3, (count,), generator=g)
    corner = torch.stack([torch.arange(count) % (50 - side), torch.arange(count) % 9], 1)
    frames = Frames.upright(scene, side, corner)
    for a in augmentations:
        frames = frames if a.photometric else a.apply(frames, choices[a.name])
    batch = many.cut(frames, STAR)
    for a in augmentations:
        batch = a.apply(batch, choices[a.name]) if a.photometric else batch
    for k in range(count):
        patch = Patch.of(many, int(scene[k]), *corner[k].tolist(), int(side[k]))
        for a in augmentations:
            patch = AUGMENTED[a.name](patch, choices[a.name][k])
        disparity, usable = patch.truth()
        torch.testing.assert_close(batch.views[k], patch.stacked(STAR), rtol=1e-6, atol=1e-6)
        torch.testing.assert_close(batch.disparity[k], disparity)
        assert torch.equal(batch.usable[k], usable)


def test_a_window_is_a_part_of_the_square(scene):
    frames = Rotation().apply(whole(scene), torch.tensor([1]))
    outer, inner = scene.cut(frames, STAR), scene.cut(frames.window(5, 20), STAR)
    assert torch.equal(inner.views, outer.views[..., 5:25, 5:25])
    assert torch.equal(inner.disparity, outer.disparity[..., 5:25, 5:25])


def test_rotations_and_flips_are_the_symmetries_of_the_square(scene):
    def turned(*quarters: int) -> Patches:
        return made(scene, *((Rotation(), k) for k in quarters))

    flip, turn = (Flip(), 1), (Rotation(), 1)
    upright = made(scene)
    assert same(turned(1, 1, 1, 1), upright)
    for a, b in itertools.product(range(4), repeat=2):
        assert same(turned(a, b), turned((a + b) % 4))
    assert same(made(scene, flip, flip), upright)
    assert same(made(scene, flip, turn, flip), turned(3))
    assert not same(turned(1), upright)
    assert not same(made(scene, flip), upright)


def test_a_flip_of_the_paper_is_a_mirror_image_of_reversed_sign(scene):
    """Mirrored left-right as our flips do it, but for its grid, turned by half a turn."""
    reversed_ = made(scene, (SignReversal(), 1))
    mirrored = made(scene, (Rotation(), 1), (Flip(), 1))
    upright = made(scene)
    assert torch.equal(
        mirrored.views[0, STAR.index((1, 1))], upright.views[0, STAR.index((1, -1))].flip(-1)
    )
    turned = [STAR.index((-row, -col)) for row, col in STAR]
    assert torch.equal(reversed_.views, mirrored.views[:, turned])
    assert torch.equal(reversed_.disparity, -mirrored.disparity)
    assert torch.equal(reversed_.usable, mirrored.usable)


def test_a_turn_or_flip_of_the_reference_code_is_one_of_five(scene):
    for k in range(4):
        assert same(made(scene, (TurnOrFlip(), k)), made(scene, (Rotation(), k)))
    assert same(made(scene, (TurnOrFlip(), 4)), made(scene, (Flip(), 1)))
    odds = np.bincount(TurnOrFlip().draw(generator(1), 2000)) / 2000
    assert np.allclose(odds, 0.2, atol=0.04)


def test_what_is_done_can_be_undone(scene):
    upright = made(scene)
    assert same(made(scene, (SignReversal(), 1), (SignReversal(), 1)), upright)
    for row, col in SHIFTS:
        assert same(made(scene, (ViewShift(), (row, col)), (ViewShift(), (-row, -col))), upright)
    for power in (0.8, 1.2):
        back = made(scene, (Gamma(), power), (Gamma(), 1 / power))
        assert torch.allclose(back.views, upright.views, atol=1e-5)
    back = made(scene, (ColourScale(), 0.5), (ColourScale(), 2.0))
    assert torch.allclose(back.views, upright.views)


def test_scales_multiply_and_divide_the_disparity(scene):
    assert same(made(scene, (Scale(), 2), (Scale(), 2)), made(scene, (Scale(), 4)))
    third = made(scene, (Scale(), 3))
    assert third.views.shape[-2:] == (19, 19)
    assert torch.equal(third.disparity, made(scene).disparity[:, ::3, ::3] / 3)


def consistent(patches: Patches, off_px: float = 0.0) -> float:
    """Mean difference of all views of the 3x3 star to the centre, found along the truth."""
    disparity = patches.disparity[0].numpy() + off_px
    height, width = disparity.shape
    y, x = np.mgrid[:height, :width].astype(float)
    views = gray(patches).views[0, :, 0].numpy()
    centre = views[STAR.index((0, 0))]
    differences = []
    for (row, col), view in zip(STAR, views, strict=True):
        at_y, at_x = y - disparity * row, x - disparity * col
        inside = (at_y >= 0) & (at_y <= height - 1) & (at_x >= 0) & (at_x <= width - 1)
        seen = map_coordinates(view, [at_y, at_x], order=3, mode="nearest")
        if (row, col) != (0, 0):
            differences.append(np.abs(seen - centre)[inside])
    return float(np.mean(np.concatenate(differences)))


CASES = [
    *((ViewShift(), shift) for shift in SHIFTS),
    *((Rotation(), quarters) for quarters in range(4)),
    *((Flip(), choice) for choice in (0, 1)),
    *((TurnOrFlip(), choice) for choice in range(5)),
    *((SignReversal(), choice) for choice in (0, 1)),
    (Scale(), 2),
    (GrayWeights(), torch.tensor([0.1, 0.2, 0.7])),
    (ColourScale(), 0.5),
    (ColourScale(), 2.0),
    (Gamma(), 0.8),
    (Gamma(), 1.2),
    (CameraFaults(Faults.none()), 5),
]


@pytest.mark.parametrize(
    ("augmentation", "choice"), CASES, ids=[f"{a.name}-{k}" for k, (a, _) in enumerate(CASES)]
)
def test_views_stay_consistent_with_their_truth(scene, augmentation, choice):
    """The wrong axis, order, sign or centre's truth would show: .3 px off is clearly worse."""
    if isinstance(augmentation, Scale):  # what every other pixel can hold
        smooth = gaussian_filter(scene.views.numpy(), (0, 0, 0, 2, 2))
        scene = replace(scene, views=torch.from_numpy(smooth))
    patches = made(scene, (augmentation, choice))
    right = consistent(patches)
    assert right < 0.025
    assert right < 0.6 * min(consistent(patches, 0.3), consistent(patches, -0.3))


def test_a_wrong_centre_or_axis_is_not_consistent():
    """The bugs of the reference code that the law above must find."""
    scene = scenes(11)
    upright, frames = made(scene), whole(scene)
    swapped = scene.cut(replace(frames, grid=frames.grid.flip(1)), STAR)  # axes exchanged
    assert consistent(swapped) > 1.5 * consistent(upright)
    shifted = made(scene, (ViewShift(), (1, 1)))
    wrong = replace(shifted, disparity=upright.disparity)
    assert consistent(wrong) > 1.1 * consistent(shifted)


def test_a_shift_without_truth_is_refused(scene):
    centre = replace(
        scene, disparity=scene.disparity[:, 4:5], usable=scene.usable[:, 4:5], truths=((0, 0),)
    )
    with pytest.raises(ValueError, match=r"no truth of the view at \(0, 1\)"):
        made(centre, (ViewShift(), (0, 1)))
    assert same(made(centre, (ViewShift(), (0, 0))), made(scene))
    with pytest.raises(ValueError, match=r"no view at \(3, 0\)"):
        scene.cut(whole(scene), [(0, 0), (3, 0)])


def test_a_shift_of_a_five_view_network_has_its_nine_grids():
    """The reference code has none for 5 views."""
    needs = Needs(views=5, shifted=True)
    star = set(Needs(views=5).offsets)
    for row, col in SHIFTS:
        moved = {(r - row, c - col) for r, c in needs.offsets}
        assert star <= moved
    assert needs.grid == 7
    assert len(needs.truths) == 9


def test_gray_weights_are_one_mixture_for_all_views(scene):
    (weights,) = GrayWeights().draw(generator(1), 1)
    assert float(weights.sum()) == pytest.approx(1)
    assert float(weights.min()) > 0
    colours, mixed = made(scene).views[0], made(scene, (GrayWeights(), weights)).views[0]
    for rgb, view in zip(colours.numpy(), mixed.numpy(), strict=True):
        expected = sum(float(w) * channel for w, channel in zip(weights, rgb, strict=True))
        assert np.allclose(view[0], expected, atol=1e-6)
    luma = gray(made(scene)).views[0, :, 0].numpy()
    red, green, blue = colours.movedim(1, 0).numpy()
    assert np.allclose(luma, 0.299 * red + 0.587 * green + 0.114 * blue, atol=1e-6)


def test_the_papers_augmentations_make_288_light_fields_of_one(scene):
    """As its section 3.3 has it for views of 7x7: every combination of the recipe's, all unlike."""
    g = generator(2)
    changes = [a for a in load_recipe("paper-7x7").chosen_augmentations() if not a.photometric]
    frames = whole(scene)
    for augmentation in changes:
        choices = augmentation.draw(g, 300).unique(dim=0)
        count = len(frames.scene)
        frames = frames[torch.arange(count).repeat_interleave(len(choices))]
        frames = augmentation.apply(frames, choices.repeat(count, *[1] * (choices.ndim - 1)))
    assert len(frames.scene) == 288

    def seen(k: int) -> bytes:
        """What the network sees and learns: the 3x3 star, in order, and the truth."""
        one = frames[torch.tensor([k])]
        patch = scene.cut(one, STAR)
        return b"".join(t.numpy().tobytes() for t in (patch.views, patch.disparity))

    assert len({seen(k) for k in range(288)}) == 288
