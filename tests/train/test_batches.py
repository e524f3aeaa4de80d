"""Batches: what they hold, what they leave out, and that they depend on seed and step alone."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from epinet.angular import CENTRAL_NINE, direction_positions
from epinet.inspect.disparity_range import searched
from epinet.inspect.information import WINDOW_PX
from epinet.networks.inputs import GRAY
from epinet.train.augment import AUGMENTATIONS, ColourScale, GrayWeights, ViewShift
from epinet.train.batches import TRIES, Batches, Cut, batches_of, textured
from epinet.train.patches import Frames, LightFields
from epinet.train.recipe import Recipe
from epinet.train.recipe_files import load_recipe
from epinet.train.sources import STEPS_PER_POOL, Mixed, Needs

OURS = {"views": 3, "batch": 2, "patch_px": 4, "steps": 100}


class Fixed:
    """A source that gives the same scenes again and again, in turn."""

    def __init__(self, *scenes: LightFields, noise: float | None = None) -> None:
        views, disparity, usable = (
            torch.cat([getattr(scene, name) for scene in scenes])
            for name in ("views", "disparity", "usable")
        )
        self.scenes = replace(scenes[0], views=views, disparity=disparity, usable=usable)
        self.noise, self.given = noise, 0

    def draw(self, g, step, side_px):
        turn = torch.arange(self.given, self.given + len(side_px))
        self.given += len(side_px)
        corner = torch.zeros(len(side_px), 2, dtype=torch.int64)
        return Frames.upright(turn % len(self.scenes.views), side_px, corner)

    def cut(self, step, frames, offsets):
        patches = self.scenes.cut(frames, offsets)
        if self.noise is None:
            return patches
        return replace(patches, noise=torch.full_like(patches.disparity, self.noise))


def made_of(views: int, image, usable=None) -> LightFields:
    """A scene whose views are all one image (H, W)."""
    offsets = Needs(views).offsets
    image = torch.as_tensor(image, dtype=torch.float32)
    usable = torch.ones_like(image, dtype=torch.bool) if usable is None else usable
    return LightFields(
        image.expand(1, len(offsets), 1, -1, -1).contiguous(),
        offsets,
        torch.zeros_like(image)[None, None],
        usable[None, None],
    )


def numbered(needs: Needs, side: int = 24) -> LightFields:
    """A scene whose views are each of one value: their number."""
    views = torch.arange(len(needs.offsets)).view(1, -1, 1, 1, 1).repeat(1, 1, 1, side, side)
    truths = torch.arange(float(len(needs.truths))).view(1, -1, 1, 1).repeat(1, 1, side, side)
    return LightFields(views.float(), needs.offsets, truths, truths >= 0, needs.truths)


def plain(**changes) -> Cut:
    cut = {
        "views": 3,
        "directions": 4,
        "net_margin_px": 11,
        "batch": 1,
        "patch_px": 1,
        "input": GRAY,
        "texture_threshold": 0.02,
        "least_weight": None,
    }
    return Cut(**cut | changes)


@pytest.mark.parametrize("streams", [1, 2, 4])
def test_stacks_hold_each_view_where_the_network_expects_it(streams):
    offsets = Needs(5).offsets
    patch = numbered(Needs(5))
    cut = plain(views=5, directions=streams, patch_px=2, least_weight=1.0)
    stacks = Batches(cut, Fixed(patch), [], seed=1)(0).stacks[0, :, :, 0, 0]
    directions = {1: (0,), 2: (0, 90), 4: (90, 0, 45, -45)}[streams]
    for stack, direction in zip(stacks, directions, strict=True):
        expected = [offsets.index((r - 2, c - 2)) for r, c in direction_positions(direction, 5)]
        assert stack.tolist() == expected


@pytest.mark.parametrize("views", [3, 5, 7])
@pytest.mark.parametrize("shift", CENTRAL_NINE)
def test_shifted_stacks_are_those_about_the_shifted_centre(views, shift):
    """The reference code shifts two of the four stacks along the wrong axis."""
    needs = Needs(views, shifted=True)
    patch = numbered(needs)

    class Chosen(ViewShift):
        def draw(self, g, count):
            return torch.tensor([shift] * count)

    cut = plain(views=views, patch_px=2, least_weight=1.0)
    batch = Batches(cut, Fixed(patch), [Chosen()], seed=1)(0)
    half = views // 2
    for stack, direction in zip(batch.stacks[0, :, :, 0, 0], (90, 0, 45, -45), strict=True):
        expected = [
            needs.offsets.index((r - half + shift[0], c - half + shift[1]))
            for r, c in direction_positions(direction, views)
        ]
        assert stack.tolist() == expected
    assert (batch.disparity == needs.truths.index(shift)).all()


@pytest.mark.parametrize("views", [3, 7])
def test_grids_that_halve_to_an_odd_number_are_shown_whole(views):
    """Every second view of three on each side would leave out the outermost."""
    patch = made_of(views, torch.rand(24, 24))
    cut = plain(views=views, patch_px=2, least_weight=1.0, fewer_views=1.0)
    batches = Batches(cut, Fixed(patch), [], seed=1)
    assert {batches(step).every for step in range(4)} == {1}


@pytest.mark.parametrize("name", ["fast-9x9", "paper-7x7"])
def test_a_batch_depends_on_seed_and_step_alone(name):
    recipe = load_recipe(name, OURS)
    walked = batches_of(recipe, [0])[0]
    for step in range(STEPS_PER_POOL + 1):
        last = walked(step)
    jumped = batches_of(recipe, [0])[0](STEPS_PER_POOL)
    assert torch.equal(last.stacks, jumped.stacks)
    assert torch.equal(last.disparity, jumped.disparity)
    assert torch.equal(last.weight, jumped.weight)
    for other in (recipe.model_copy(update={"seed": 2}), recipe):
        (batches,) = batches_of(other, [0 if other.seed == 2 else 1])
        differs = batches(STEPS_PER_POOL)
        assert not torch.equal(last.stacks, differs.stacks)


@pytest.mark.parametrize("name", ["fast-9x9", "paper-9x9"])
def test_batches_are_light_fields_with_their_truth(name):
    """The middle of each stack is the centre view, and truth explains its neighbours."""
    recipe = load_recipe(
        name, {"views": 3, "batch": 8, "patch_px": 24, "steps": 100, "least_weight": 0.2}
    )
    batch = batches_of(recipe, [0])[0](0)
    assert batch.stacks.shape == (8, 4, 3, 46, 46)
    assert batch.disparity.shape == batch.weight.shape == (8, 1, 24, 24)
    assert all(torch.equal(batch.stacks[:, 0, 1], batch.stacks[:, s, 1]) for s in range(4))
    residuals = {}
    for sign in (1, -1):
        d = sign * batch.disparity[:, 0]
        y, x = torch.meshgrid(torch.arange(24.0), torch.arange(24.0), indexing="ij")
        at = torch.stack([(x + 11 - d) / 45 * 2 - 1, (y + 11).expand_as(d) / 45 * 2 - 1], -1)
        right = batch.stacks[:, 1, 2:3]  # the view one column to the right
        seen = torch.nn.functional.grid_sample(right, at, align_corners=True)[:, 0]
        residuals[sign] = (seen - batch.stacks[:, 1, 1, 11:-11, 11:-11]).abs().mean()
    assert residuals[1] < 0.7 * residuals[-1]


def test_textureless_surroundings_are_found_as_published():
    """Against the definition in plain loops: mean |p - p_centre| over 23x23, at least .02."""
    centre = torch.rand(1, 1, 26, 25, generator=torch.Generator().manual_seed(0)) * 0.07
    weights = textured(centre, threshold=0.02)
    assert weights.shape == (1, 1, 4, 3)
    image = centre[0, 0].numpy()
    for row in range(4):
        for col in range(3):
            patch = image[row : row + 23, col : col + 23]
            expected = np.mean(np.abs(patch - patch[11, 11])) >= 0.02
            assert bool(weights[0, 0, row, col]) == expected
    assert 0 < weights.mean() < 1


def test_textureless_patches_and_any_that_touch_a_mirror_are_rejected():
    """A mirror of any scene counts: the reference code's test reaches a single scene."""
    rough = torch.rand(23, 23, generator=torch.Generator().manual_seed(1))
    flat = torch.full((23, 23), 0.5)
    mirror = torch.ones(23, 23, dtype=torch.bool)
    mirror[0, 22] = False  # in the corner of the views, far from the one pixel of the map
    source = Fixed(made_of(3, flat), made_of(3, rough, mirror), made_of(3, rough))
    batch = Batches(plain(), source, [], seed=1)(0)
    assert source.given == 3
    assert torch.equal(batch.stacks[0, 0, 0], rough)
    assert batch.weight.item() == 1


def test_places_that_find_nothing_take_what_others_found():
    """So that no textureless patch enters the norms' statistics; alone, all count nothing."""
    rough = torch.rand(23, 23, generator=torch.Generator().manual_seed(1))
    flat = made_of(3, torch.full((23, 23), 0.5))
    batch = 4
    tried = 2 + (batch - 2) * (TRIES + 1)  # two are found at once, the others never
    found = [made_of(3, rough), made_of(3, rough.T)]
    source = Fixed(*found, *[flat] * tried)
    made = Batches(plain(batch=batch), source, [], seed=1)(0)
    stacks, weight = made.stacks, made.weight
    assert source.given == batch + (batch - 2) * (TRIES - 1)
    assert torch.equal(stacks[0, 0, 0], rough)
    assert torch.equal(stacks[1, 0, 0], rough.T)
    for stack in stacks[2:, 0, 0]:
        assert torch.equal(stack, rough) or torch.equal(stack, rough.T)
    assert (weight == 1).all()
    nothing = Batches(plain(batch=batch), Fixed(flat), [], seed=1)(0)
    assert (nothing.weight == 0).all()


def test_texture_is_judged_in_the_gray_that_the_network_sees():
    """Green texture is none to a mixture of red and blue; exposure makes none."""
    rough = torch.rand(23, 23, generator=torch.Generator().manual_seed(1))
    green = torch.stack([torch.full_like(rough, 0.5), rough, torch.full_like(rough, 0.5)])
    grays = made_of(3, rough)
    coloured = green.expand(1, len(grays.offsets), -1, -1, -1).contiguous()
    scene = replace(grays, views=coloured)

    class Without(GrayWeights):
        def draw(self, g, count):
            return torch.tensor([[0.5, 0.0, 0.5]]).expand(count, 3).clone()

    for augmentations, accepted in (
        ([], 1),
        ([Without()], 0),
        ([ColourScale((1e-3, 2e-3))], 1),
    ):
        batch = Batches(plain(), Fixed(scene), augmentations, seed=1)(0)
        assert (batch.weight == accepted).all()


def test_our_recipe_keeps_every_patch_and_weighs_its_pixels():
    rough = torch.rand(60, 60, generator=torch.Generator().manual_seed(1))
    image = torch.where(torch.arange(60) < 30, torch.full((60, 60), 0.5), rough)
    usable = torch.ones(60, 60, dtype=torch.bool)
    usable[:30] = False
    cut = plain(patch_px=30, least_weight=0.2)
    source = Fixed(made_of(3, image, usable))
    weight = Batches(cut, source, [], seed=1)(0).weight[0, 0]
    assert source.given == 1
    assert (weight[:19] == 0).all()  # map row 0 is view row 11
    untold = 30 - 1 - WINDOW_PX // 2 - 11  # columns from which no window reaches the texture
    assert (weight[19:, :untold] == weight.new_tensor(0.2)).all()
    assert (weight[19:, -10:] > 0.99).all()


def test_noise_makes_pixels_count_less():
    faint = 0.5 + 0.03 * torch.rand(60, 60, generator=torch.Generator().manual_seed(1))
    sources = [Fixed(made_of(9, faint)), Fixed(made_of(9, faint), noise=0.05)]
    cut = plain(views=9, patch_px=30, least_weight=0.1)
    weights = [Batches(cut, source, [], seed=1)(0).weight.mean() for source in sources]
    assert weights[0] > 0.9
    assert weights[1] == pytest.approx(0.1, abs=0.02)


def test_sources_give_their_shares():
    dark, light = Fixed(made_of(3, torch.zeros(23, 23))), Fixed(made_of(3, torch.ones(23, 23)))
    cut = plain(batch=400, least_weight=1.0)
    stacks = Batches(cut, Mixed([(dark, 1.0), (light, 3.0)]), [], seed=1)(0).stacks
    assert 0.7 < float(stacks[:, 0, 0, 0, 0].mean()) < 0.8


def test_every_augmentation_of_a_recipe_reaches_its_batches(monkeypatch):
    recipe = load_recipe("paper-7x7", OURS)
    applied = set()
    for augmentation in AUGMENTATIONS.values():
        kind = type(augmentation)

        def note(self, patches, choices, kind=kind, apply=kind.apply):
            applied.add(kind.name)
            return apply(self, patches, choices)

        monkeypatch.setattr(kind, "apply", note)
    batches_of(recipe, [0])[0](0)
    assert applied == set(recipe.augmentations)


def test_the_largest_scale_fits_what_is_rendered():
    wide = {"data": [{"generator": "wide"}], "scale_weights": [0, 0, 0, 0, 0, 1]}
    recipe = load_recipe("paper-9x9", OURS | wide | {"augmentations": ["scale"]})
    batch = batches_of(recipe, [0])[0](0)
    assert batch.stacks.shape[-1] == 26
    assert isinstance(recipe, Recipe)
    low, high = recipe.disparity_range_px
    assert (low, high) == pytest.approx((-25 / 6, 5 / 6))
    assert low - 0.1 <= float(batch.disparity.min()) <= float(batch.disparity.max()) <= high + 0.1


def test_batches_of_fewer_views_keep_the_outermost_and_the_truth_per_view():
    patch = replace(numbered(Needs(9)), disparity=torch.full((1, 1, 24, 24), 0.5))
    cut = plain(views=9, patch_px=2, least_weight=1.0, fewer_views=1.0)
    batches = Batches(cut, Fixed(patch), [], seed=1)
    whole = Batches(replace(cut, fewer_views=0.0), Fixed(patch), [], seed=1)(0)
    assert whole.every == 1
    seen = set()
    for step in range(20):
        batch = batches(step)
        seen.add(batch.every)
        assert torch.equal(batch.stacks, whole.stacks[:, :, :: batch.every])
        assert torch.equal(batch.stacks[:, :, [0, -1]], whole.stacks[:, :, [0, -1]])
        assert (batch.disparity == 0.5 * batch.every).all()
        assert batch.range_px == searched(0.5 * batch.every, 0.5 * batch.every)
    assert seen == {2, 4}


def test_the_range_to_search_is_that_of_all_known_disparities():
    """Beside the map and on mirrors, too, but for those that are unknown."""
    image, truth = torch.rand(24, 24), torch.ones(2, 24, 24)
    truth[0, 0, 0], truth[1, 23, 5], truth[1, 12, 12] = -2.5, 1.5, torch.nan
    usable = torch.zeros(24, 24, dtype=torch.bool)
    patches = [replace(made_of(3, image, usable), disparity=t[None, None]) for t in truth]
    cut = plain(batch=2, patch_px=2, least_weight=1.0)
    batch = Batches(cut, Fixed(*patches), [], seed=1)(0)
    assert batch.range_px == searched(-2.5, 1.5)
    assert batch.disparity[1].flatten().tolist().count(0) == 1


def test_what_views_always_differ_by_makes_faint_texture_count_less():
    """Of two textures without noise, the fainter one tells its disparity less well."""
    g = torch.Generator().manual_seed(2)
    texture = torch.rand(32, 32, generator=g)
    weights = [
        Batches(
            plain(patch_px=4, least_weight=0.01),
            Fixed(made_of(3, 0.5 + c * texture)),
            [],
            1,
        )(0).weight.mean()
        for c in (0.002, 0.02, 0.2)
    ]
    assert weights[0] < weights[1] < weights[2]


def test_large_batches_come_in_turn_and_see_as_many_pixels():
    changes = OURS | {"batch": 4, "large_patches": 0.5}
    (batches,) = batches_of(load_recipe("fast-9x9", changes), [0])
    small = load_recipe("fast-9x9", OURS).patch_px + 22
    sides = [(len(b.stacks), b.stacks.shape[-1]) for b in map(batches, range(4))]
    assert sides == [(4, small), (1, 2 * small)] * 2
    for step in range(2):
        batch = batches(step)
        assert batch.disparity.shape[-1] == batch.stacks.shape[-1] - 22


def test_mirrors_count_as_the_recipe_says():
    usable = torch.ones(32, 32, dtype=torch.bool)
    usable[:, 16:] = False
    patch = made_of(3, torch.rand(32, 32), usable)
    for mirror_weight in (0.0, 0.3):
        cut = plain(patch_px=10, least_weight=1.0, mirror_weight=mirror_weight)
        (weight,) = Batches(cut, Fixed(patch), [], 1)(0).weight
        assert set(weight[..., :5].unique().tolist()) == {1.0}
        assert weight[..., 5:].unique().tolist() == pytest.approx([mirror_weight])
