"""Scenes on disk and rendered ones give the same kind of patches."""

import itertools
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import torch
from PIL import Image

from epinet.errors import InputError
from epinet.io import read_light_field, read_pfm, write_light_field
from epinet.synth.dataset import write_dataset
from epinet.synth.generator import draw_scene, generator
from epinet.synth.options import Options
from epinet.synth.render import truth
from epinet.train.batches import batches_of
from epinet.train.recipe import Data
from epinet.train.recipe_files import load_recipe
from epinet.train.sources import SLOTS, STEPS_PER_POOL, Folders, Mixed, Needs, Rendered


def one(source, g, views: int, side: int, step: int = 0):
    """One upright square from a source, as a batch of one."""
    return source.cut(step, source.draw(g, step, torch.tensor([side])), Needs(views).offsets)


OPTIONS = Options(size=(40, 48), views=5, samples=1, surfaces=(3, 5))


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    out = tmp_path_factory.mktemp("scenes") / "set"
    return write_dataset(out, OPTIONS, seed=3, scenes=2, truths=True)


def test_a_piece_is_a_square_of_the_files(scenes):
    source = Folders(scenes[:1], Needs(views=5), side_px=24)
    piece = one(source, generator(1), 5, 24)
    lf = read_light_field(scenes[0])
    disparity, usable = piece.disparity[0], piece.usable[0]
    corners = [
        (y, x)
        for y in range(40 - 24 + 1)
        for x in range(48 - 24 + 1)
        if np.array_equal(lf.truth[y : y + 24, x : x + 24], disparity.numpy())
    ]
    ((y, x),) = corners
    for k, (row, col) in enumerate(Needs(views=5).offsets):
        expected = lf.rgb(2 + row, 2 + col)[y : y + 24, x : x + 24].transpose(2, 0, 1)
        assert np.allclose(piece.views[0, k].numpy(), expected)
    mask = lf.masks["invalid"][y : y + 24, x : x + 24]
    assert np.array_equal(usable.numpy(), ~mask)
    again = [one(source, generator(k), 5, 24).views[0, 0, 0, 0, :3] for k in range(9)]
    assert len({tuple(first) for first in again}) > 3


def test_squares_of_several_scenes_and_sources_come_in_their_order(scenes):
    """Cut together and one by one, from folders of different sizes and from rendered scenes."""
    needs = Needs(views=3)
    both = Folders(scenes, needs, side_px=24)
    whole = both.scenes[1]
    trimmed = {n: getattr(whole, n)[..., 3:].contiguous() for n in ("views", "disparity", "usable")}
    both.scenes[1] = replace(whole, **trimmed)
    both._sizes[1, 1] -= 3
    options = Options(samples=1, surfaces=(1, 2))
    rendered = Rendered([(options, 1.0)], needs, seed=1, count=2, side_px=24)
    mixed = Mixed([(both, 2.0), (rendered, 1.0)])
    frames = mixed.draw(generator(3), 0, torch.full((12,), 24))
    assert set(zip(frames.source.tolist(), frames.scene.tolist(), strict=True)) == {
        (0, 0),
        (0, 1),
        (1, 0),
        (1, 1),
    }
    together = mixed.cut(0, frames, needs.offsets)
    assert together.views.shape == (12, 9, 3, 24, 24)
    for k in range(12):
        alone = mixed.cut(0, frames[torch.tensor([k])], needs.offsets)
        assert torch.equal(together.views[k], alone.views[0].expand(-1, 3, -1, -1))
        assert torch.equal(together.disparity[k], alone.disparity[0])
        assert torch.equal(together.usable[k], alone.usable[0])


def test_truths_of_the_nine_central_views_come_from_their_files(scenes):
    """Against the renderer's truth of each view."""
    needs = Needs(views=3, shifted=True)
    source = Folders(scenes[1:], needs, side_px=40)
    frames = source.draw(generator(1), 0, torch.tensor([40]))
    shifted = [replace(frames, middle=torch.tensor([truth])) for truth in needs.truths]
    found = torch.cat([source.cut(0, f, [(0, 0)]).disparity for f in shifted])
    drawn, _ = draw_scene(OPTIONS, 3, 1)
    expected, _ = truth(drawn, needs.truths)
    offset = next(
        x for x in range(9) if torch.allclose(expected[0, ..., x : x + 40], found, atol=1e-5)
    )
    assert 0 <= offset <= 8
    assert not torch.allclose(found[0], found[8])
    assert read_pfm(scenes[1] / "gt_disp_lowres_Cam018.pfm").shape == (40, 48)
    assert len(list(scenes[1].glob("gt_disp_lowres_Cam*.pfm"))) == 8


def test_scenes_are_drawn_by_their_weights(scenes):
    """The quarter that the reference code gives to scenes with mirrors."""
    g, names = generator(1), [scene.name for scene in scenes]

    def drawn(weights) -> Counter:
        source = Folders(scenes, Needs(views=3), side_px=24, weights=weights)
        kept = [scene.disparity[0] for scene in source.scenes]
        pieces = source.cut(0, source.draw(g, 0, torch.full((500,), 40)), [(0, 0)]).disparity
        return Counter(
            next(n for n, k in zip(names, kept, strict=True) if torch.isin(p, k).all())
            for p in pieces
        )

    assert drawn({names[0]: 0.25})[names[0]] / 500 == pytest.approx(0.2, abs=0.05)
    assert drawn({"elsewhere": 0.25})[names[0]] / 500 == pytest.approx(0.5, abs=0.06)
    assert drawn({names[1]: 0.0})[names[1]] == 0
    with pytest.raises(InputError, match="scene_weights: leave nothing of the scenes scene_00000"):
        Folders(scenes[:1], Needs(views=3), side_px=24, weights={names[0]: 0.0})


def test_mirrors_without_a_mask_are_told(scenes, tmp_path, log):
    """Of HCI's scenes that have some; the reference code's own name of the mask will do."""
    lf = replace(read_light_field(scenes[0]), masks={})
    for name in ("kitchen", "museum", "boxes"):
        write_light_field(tmp_path / name, lf, "hci")
    alpha = np.zeros((*lf.size, 4), np.uint8)
    alpha[5:9, 6:20, 3] = 1
    Image.fromarray(alpha).save(tmp_path / "museum" / "input_Cam040_invalid_ver2.png")
    recipe = load_recipe("paper-9x9", {"views": 3, "scale_weights": [1]})
    recipe = recipe.model_copy(update={"data": (Data(folder=tmp_path),)})
    batches_of(recipe, [0])
    assert len(log.messages) == 1 and "kitchen: no mask of its mirrors" in log.messages[0]
    (museum,) = Folders([tmp_path / "museum"], Needs(views=3), side_px=24).scenes
    np.testing.assert_array_equal(~museum.usable[0, 0].numpy(), alpha[..., 3] > 0)


def test_what_is_missing_is_named_all_at_once(scenes, tmp_path):
    lf = read_light_field(scenes[0])
    bare = tmp_path / "bare"
    write_light_field(bare, lf, "hci")
    (bare / "gt_disp_lowres.pfm").unlink()
    centre_only = tmp_path / "centre_only"
    write_light_field(centre_only, lf, "hci")
    with pytest.raises(InputError) as caught:
        Folders([bare, centre_only], Needs(views=3, shifted=True), side_px=24)
    text = str(caught.value)
    assert "bare: no truth" in text
    assert "gt_disp_lowres_Cam006.pfm" in text
    assert "view_shift needs the truth of the nine central views" in text
    assert "synth --truths" in text
    Folders([centre_only], Needs(views=3), side_px=24)


def test_of_a_folder_scenes_that_cannot_be_used_are_left_out(scenes, tmp_path, log):
    lf = read_light_field(scenes[0])
    write_light_field(tmp_path / "training" / "boxes", lf, "hci")
    write_light_field(tmp_path / "test" / "herbs", replace(lf, truth=None), "hci")
    write_light_field(tmp_path / "small", lf.central(3), "hci")
    (tmp_path / "readme.txt").touch()
    log.clear()
    source = Folders([tmp_path], Needs(views=5), side_px=24)
    assert len(source.scenes) == 1
    text = "\n".join(log.messages)
    assert "herbs: no truth" in text and "small: 5x5 views are needed" in text
    assert "readme.txt in" in text
    for named in ([tmp_path, tmp_path / "test" / "herbs"], [tmp_path / "test"]):
        with pytest.raises(InputError, match="herbs: no truth"):
            Folders(named, Needs(views=5), side_px=24)
    (tmp_path / "small" / "input_Cam004.png").write_bytes(b"broken")
    with pytest.raises(InputError, match="Cam004"):
        Folders([tmp_path], Needs(views=5), side_px=24)


def test_a_star_has_too_few_views_for_view_shift(tmp_path):
    out = write_dataset(tmp_path / "star", OPTIONS, seed=3, scenes=1, star_only=True, truths=True)
    with pytest.raises(InputError, match="view_shift needs all of them"):
        Folders(out, Needs(views=3, shifted=True), side_px=24)


def test_views_smaller_than_a_patch(scenes):
    with pytest.raises(InputError, match="48x40 px are smaller than a patch"):
        Folders(scenes, Needs(views=3), side_px=41)


def test_rendered_pools_serve_several_steps_and_never_change_together():
    """And what a step sees does not depend on where the run began."""
    options, needs = Options(samples=1, surfaces=(1, 2)), Needs(views=3)
    steps = (SLOTS + 2) * STEPS_PER_POOL

    def reach(step: int) -> float:
        return 0.5 + step / (3 * steps)

    def source() -> Rendered:
        return Rendered([(options, 1.0)], needs, seed=1, count=1, side_px=16, reach=reach)

    def scene(rendered: Rendered, step: int) -> float:
        one(rendered, generator(0), 3, 16, step)
        return float(rendered._slots[step % SLOTS][1].disparity.double().sum())

    walked = source()
    seen = [scene(walked, step) for step in range(steps)]
    uses = Counter(seen)
    whole = [s for s in uses if s not in seen[:SLOTS] and s not in seen[-SLOTS:]]
    assert whole
    assert {uses[s] for s in whole} == {STEPS_PER_POOL}
    news = [k for k, s in enumerate(seen) if s not in seen[:k] and k >= SLOTS]
    assert all(b - a >= STEPS_PER_POOL - 1 for a, b in itertools.pairwise(news))
    for step in (3, steps // 2, steps - 1):
        assert scene(source(), step) == seen[step]


def test_each_pool_is_of_one_kind_and_kinds_come_by_their_shares():
    near = Options(samples=1, surfaces=(1, 2), disparity_px=(2.0, 3.0))
    far = replace(near, disparity_px=(-3.0, -2.0))

    def source() -> Rendered:
        kinds = [(near, 0.7), (far, 0.3)]
        return Rendered(kinds, Needs(views=3), seed=1, count=2, side_px=16)

    rendered, signs = source(), []
    for step in range(2 * SLOTS * STEPS_PER_POOL):
        frames = rendered.draw(generator(0), step, torch.tensor([16, 16]))
        both = rendered.cut(step, frames, [(0, 0)]).disparity > 0
        assert both.all() or not both.any()
        signs.append(bool(both.all()))
    assert 0.4 < sum(signs) / len(signs) < 0.95
    jumped = source()  # a resumed run sees the same kinds
    assert bool((one(jumped, generator(0), 3, 16, step).disparity > 0).all()) == signs[-1]


def test_a_place_of_the_batch_sees_every_scene_of_a_pool_and_a_batch_each_once():
    needs = Needs(views=3)
    source = Rendered([(Options(), 1.0)], needs, seed=1, count=4, side_px=16)
    drawn = [source.draw(generator(k), 0, torch.full((4,), 16)).scene.tolist() for k in range(60)]
    assert all(sorted(scenes) == [0, 1, 2, 3] for scenes in drawn)
    for place in zip(*drawn, strict=True):
        assert set(place) == {0, 1, 2, 3}
