"""Laws of the augmentations: groups, undoing, and photo-consistency of what they make."""

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
    Patch,
    Rotation,
    Scale,
    SignReversal,
    TurnOrFlip,
    ViewShift,
    gray,
)
from epinet.train.recipe_files import load_recipe
from epinet.train.sources import Needs

NEEDS = Needs(views=3, shifted=True)
SHIFTS = tuple(itertools.product((-1, 0, 1), repeat=2))


def scene(seed: int) -> Patch:
    """All nine 3x3 stars inside 5x5 views of a scene in colour, and the truth of their centres."""
    options = Options(
        size=(56, 56),
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
    made = pools(options, seed, count=1, offsets=NEEDS.offsets, truths=NEEDS.truths, gray=False)
    pool = next(made)
    return Patch(pool.views[0], NEEDS.offsets, pool.disparity[0], pool.valid[0], NEEDS.truths)


@pytest.fixture(scope="module")
def patch() -> Patch:
    return scene(9)


def same(a: Patch, b: Patch) -> bool:
    """Equal, whatever the order of their views."""
    return (
        set(a.offsets) == set(b.offsets)
        and set(a.truths) == set(b.truths)
        and all(torch.equal(a.view(o), b.view(o)) for o in a.offsets)
        and all(
            torch.equal(a.disparity[a.truths.index(o)], b.disparity[b.truths.index(o)])
            for o in a.truths
        )
        and all(
            torch.equal(a.usable[a.truths.index(o)], b.usable[b.truths.index(o)]) for o in a.truths
        )
    )


def turned(patch: Patch, quarters: int) -> Patch:
    return Rotation().apply(patch, quarters)


def flipped(patch: Patch) -> Patch:
    return Flip().apply(patch, True)


def test_rotations_and_flips_are_the_symmetries_of_the_square(patch):
    assert same(turned(turned(turned(turned(patch, 1), 1), 1), 1), patch)
    for a, b in itertools.product(range(4), repeat=2):
        assert same(turned(turned(patch, a), b), turned(patch, (a + b) % 4))
    assert same(flipped(flipped(patch)), patch)
    assert same(flipped(turned(flipped(patch), 1)), turned(patch, 3))
    assert not same(turned(patch, 1), patch)
    assert not same(flipped(patch), patch)


def test_a_flip_of_the_paper_is_a_mirror_image_of_reversed_sign(patch):
    """Mirrored left-right as our flips do it, but for its grid, turned by half a turn."""
    mirrored = flipped(turned(patch, 1))
    assert torch.equal(mirrored.view((1, 1)), patch.view((1, -1)).flip(-1))
    expected = mirrored.mapped(lambda image: image, lambda o: (-o[0], -o[1]))
    expected = replace(expected, disparity=-expected.disparity)
    assert same(SignReversal().apply(patch, True), expected)


def test_a_turn_or_flip_of_the_reference_code_is_one_of_five(patch):
    made = [TurnOrFlip().apply(patch, choice) for choice in range(5)]
    for k in range(4):
        assert same(made[k], turned(patch, k))
    assert same(made[4], flipped(patch))
    g = generator(1)
    odds = np.bincount([TurnOrFlip().draw(g) for _ in range(2000)]) / 2000
    assert np.allclose(odds, 0.2, atol=0.04)


def test_what_is_done_can_be_undone(patch):
    assert same(SignReversal().apply(SignReversal().apply(patch, True), True), patch)
    shift = ViewShift()
    for row, col in SHIFTS:
        assert same(shift.apply(shift.apply(patch, (row, col)), (-row, -col)), patch)
    for power in (0.8, 1.2):
        back = Gamma().apply(Gamma().apply(patch, power), 1 / power)
        assert torch.allclose(back.views, patch.views, atol=1e-5)
    back = ColourScale().apply(ColourScale().apply(patch, 0.5), 2.0)
    assert torch.allclose(back.views, patch.views)


def test_scales_multiply_and_divide_the_disparity(patch):
    assert same(Scale().apply(Scale().apply(patch, 2), 2), Scale().apply(patch, 4))
    third = Scale().apply(patch, 3)
    assert third.views.shape[-2:] == (19, 19)
    assert torch.equal(third.disparity, patch.disparity[:, ::3, ::3] / 3)


def consistent(patch: Patch, off_px: float = 0.0) -> float:
    """Mean difference of all views of the 3x3 star to the centre, found along the truth."""
    disparity = patch.truth()[0].numpy() + off_px
    height, width = disparity.shape
    y, x = np.mgrid[:height, :width].astype(float)
    centre = gray(patch).view((0, 0))[0].numpy()
    differences = []
    for row, col in Needs(views=3).offsets:
        view = gray(patch).view((row, col))[0].numpy()
        at_y, at_x = y - disparity * row, x - disparity * col
        inside = (at_y >= 0) & (at_y <= height - 1) & (at_x >= 0) & (at_x <= width - 1)
        seen = map_coordinates(view, [at_y, at_x], order=3, mode="nearest")
        if (row, col) != (0, 0):
            differences.append(np.abs(seen - centre)[inside])
    return float(np.mean(np.concatenate(differences)))


CASES = [
    *((ViewShift(), shift) for shift in SHIFTS),
    *((Rotation(), quarters) for quarters in range(4)),
    *((Flip(), choice) for choice in (False, True)),
    *((TurnOrFlip(), choice) for choice in range(5)),
    *((SignReversal(), choice) for choice in (False, True)),
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
def test_views_stay_consistent_with_their_truth(patch, augmentation, choice):
    """The wrong axis, order, sign or centre's truth would show: .3 px off is clearly worse."""
    if isinstance(augmentation, Scale):  # what every other pixel can hold
        smooth = gaussian_filter(patch.views.numpy(), (0, 0, 2, 2))
        patch = replace(patch, views=torch.from_numpy(smooth))
    made = augmentation.apply(patch, choice)
    right = consistent(made)
    assert right < 0.025
    assert right < 0.6 * min(consistent(made, 0.3), consistent(made, -0.3))


def test_a_wrong_centre_or_axis_is_not_consistent():
    """The bugs of the reference code that the law above must find."""
    patch = scene(11)
    swapped = patch.mapped(lambda image: image, lambda o: (o[1], o[0]))  # axes exchanged
    assert consistent(swapped) > 1.5 * consistent(patch)
    shifted = ViewShift().apply(patch, (1, 1))
    wrong = Patch(shifted.views, shifted.offsets, patch.disparity, patch.usable, patch.truths)
    assert consistent(wrong) > 1.1 * consistent(shifted)


def test_a_shift_without_truth_is_refused(patch):
    centre = Patch(patch.views, patch.offsets, patch.disparity[4:5], patch.usable[4:5], ((0, 0),))
    with pytest.raises(ValueError, match="no truth"):
        ViewShift().apply(centre, (0, 1))
    assert ViewShift().apply(centre, (0, 0)).offsets == patch.offsets


def test_a_shift_of_a_five_view_network_has_its_nine_grids():
    """The reference code has none for 5 views."""
    needs = Needs(views=5, shifted=True)
    star = set(Needs(views=5).offsets)
    for row, col in SHIFTS:
        moved = {(r - row, c - col) for r, c in needs.offsets}
        assert star <= moved
    assert needs.grid == 7
    assert len(needs.truths) == 9


def test_gray_weights_are_one_mixture_for_all_views(patch):
    weights = GrayWeights().draw(generator(1))
    assert float(weights.sum()) == pytest.approx(1)
    assert float(weights.min()) > 0
    mixed = GrayWeights().apply(patch, weights)
    for offset in patch.offsets:
        rgb = patch.view(offset).numpy()
        expected = sum(float(w) * channel for w, channel in zip(weights, rgb, strict=True))
        assert np.allclose(mixed.view(offset)[0].numpy(), expected, atol=1e-6)
    luma = gray(patch).view((0, 0))[0].numpy()
    red, green, blue = patch.view((0, 0)).numpy()
    assert np.allclose(luma, 0.299 * red + 0.587 * green + 0.114 * blue, atol=1e-6)


def test_the_papers_augmentations_make_288_light_fields_of_one(patch):
    """As its section 3.3 has it for views of 7x7: every combination of the recipe's, all unlike."""
    g = generator(2)
    changes = [a for a in load_recipe("paper-7x7").chosen_augmentations() if not a.photometric]
    made = [patch]
    for augmentation in changes:
        choices = {augmentation.draw(g) for _ in range(300)}
        made = [augmentation.apply(p, choice) for p in made for choice in choices]
    assert len(made) == 288

    def key(p: Patch) -> bytes:
        """Of what the network sees and learns: the 3x3 star, in order, and the truth."""
        star = [p.view(offset) for offset in Needs(views=3).offsets]
        return b"".join(t.numpy().tobytes() for t in (*star, *p.truth()))

    assert len({key(p) for p in made}) == len(made)


def test_choices_are_those_of_the_paper():
    """And the ranges of colour."""
    g = generator(2)

    def seen(augmentation) -> set:
        return {augmentation.draw(g) for _ in range(300)}

    assert seen(ViewShift()) == set(SHIFTS)
    assert seen(Rotation()) == {0, 1, 2, 3}
    assert seen(Flip()) == seen(SignReversal()) == {False, True}
    assert seen(Scale((1, 1, 1, 1))) == {1, 2, 3, 4}
    odds = [Scale((8, 6, 3)).draw(g) for _ in range(4000)]
    assert np.allclose(np.bincount(odds)[1:] / 4000, np.array([8, 6, 3]) / 17, atol=0.03)
    factors = sorted(seen(ColourScale()))
    assert 0.5 <= factors[0] < 0.55
    assert 1.9 < factors[-1] <= 2
    powers = sorted(seen(Gamma()))
    assert 0.8 <= powers[0] < 0.82
    assert 1.18 < powers[-1] <= 1.2


def test_photometric_augmentations_come_last_and_leave_the_truth_alone(patch):
    flags = [a.photometric for a in AUGMENTATIONS.values()]
    assert flags == sorted(flags)
    for augmentation in AUGMENTATIONS.values():
        made = augmentation.apply(patch, augmentation.draw(generator(3)))
        if augmentation.photometric:
            assert torch.equal(made.disparity, patch.disparity)
            assert made.offsets == patch.offsets


def test_the_noise_that_a_patch_states_is_that_of_its_views():
    """Whatever changes of colour come before: on plain grey, against the spread of the pixels."""
    shape = (1, 256, 256)
    plain = Patch(
        torch.full((1, 3, 256, 256), 0.3),
        ((0, 0),),
        torch.zeros(shape),
        torch.ones(shape, dtype=torch.bool),
    )
    noisy = CameraFaults(replace(Faults.none(), noise=1.0, full=True))
    choices = {"gray_weights": torch.tensor([0.2, 0.5, 0.3]), "colour_scale": 2.0, "gamma": 0.8}
    made = plain
    for augmentation in AUGMENTATIONS.values():
        if augmentation.name in choices:
            made = augmentation.apply(made, choices[augmentation.name])
        elif augmentation.name == noisy.name:
            made = noisy.apply(made, 7)
    assert made.noise is not None and made.noise.mean() > 0.005
    assert float(made.views.std()) == pytest.approx(float(made.noise.mean()), rel=0.05)
