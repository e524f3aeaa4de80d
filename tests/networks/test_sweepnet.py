"""SweepNet: what it is shown, against plain slow versions and planes of known disparity."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from epinet.angular import DIRECTIONS_DEG, direction_positions
from epinet.networks.base import config_as_dict
from epinet.networks.sweepnet import SweepNet, SweepNetConfig
from epinet.networks.sweepnet.matching import (
    ARMS,
    OUTERMOST,
    PARTS,
    Squares,
    Views,
    doubled,
    gathered,
    summed,
)
from epinet.shifts import sampled

SIDE_PX = 48
INNER = (..., slice(12, -12), slice(12, -12))


def texture(x, y):
    """Smooth, without a direction or a period of its own."""
    waves = [(0.31, 0.17, 0.4), (-0.23, 0.41, 1.9), (0.12, -0.37, 2.2), (0.47, 0.08, 0.7)]
    return 0.5 + 0.1 * sum(np.sin(a * x + b * y + c) for a, b, c in waves)


def plane(disparity: float, views: int = 9, side: int = SIDE_PX) -> torch.Tensor:
    """Stacks (1, 4, N, H, W) of a textured plane, exact: a formula drawn for every view."""
    y, x = np.mgrid[:side, :side].astype(float)
    half = views // 2
    stacks = [
        [
            texture(x + disparity * (col - half), y + disparity * (row - half))
            for row, col in direction_positions(direction, views)
        ]
        for direction in DIRECTIONS_DEG
    ]
    return torch.tensor(np.array(stacks), dtype=torch.float32)[None]


def test_arms_are_the_eight_ways_out_of_the_centre():
    assert {(row, col) for *_, row, col in ARMS} == {
        (r, c) for r in (-1, 0, 1) for c in (-1, 0, 1)
    } - {(0, 0)}
    views = Views(plane(0.7, views=5))
    for (stream, side, row, col), (_, _, seen) in zip(ARMS, views.arms, strict=True):
        positions = direction_positions(DIRECTIONS_DEG[stream], 5)
        assert positions[2 + 2 * side] == (2 + 2 * row, 2 + 2 * col)
        assert torch.equal(seen[0, 1], plane(0.7, views=5)[0, stream, 2 + 2 * side])


def test_sampling_is_bilinear_where_the_views_show_the_point():
    g = torch.Generator().manual_seed(1)
    views = torch.rand(2, 2, 7, 9, generator=g)
    disparity = 3 * torch.rand(2, 1, 7, 9, generator=g) - 1.5
    moves = [(0.0, 2.0), (-1.5, 1.5)]
    found = sampled(views, disparity, moves)
    for b, p, y, x in np.ndindex(*views.shape):
        row, col = moves[p]
        d = disparity[b, 0, y, x].item()
        v, u = min(max(y - row * d, 0), 6), min(max(x - col * d, 0), 8)
        v0, u0 = min(int(v), 5), min(int(u), 7)
        fv, fu = v - v0, u - u0
        image = views[b, p]
        expected = (1 - fv) * ((1 - fu) * image[v0, u0] + fu * image[v0, u0 + 1]) + fv * (
            (1 - fu) * image[v0 + 1, u0] + fu * image[v0 + 1, u0 + 1]
        )
        assert found[b, p, y, x].item() == pytest.approx(expected.item(), abs=1e-4)


def test_doubled_views_have_cubic_points_between_their_pixels():
    views = torch.rand(2, 3, 7, 9, generator=torch.Generator().manual_seed(2))
    x, y = torch.arange(18) / 2, torch.arange(14) / 2
    across, down = (2 * x + 1) / 9 - 1, (2 * y + 1) / 7 - 1  # as grid_sample counts
    places = torch.stack(torch.meshgrid(across, down, indexing="xy"), -1).expand(2, -1, -1, -1)
    wanted = F.grid_sample(views, places, "bicubic", "border", align_corners=False)
    assert torch.allclose(doubled(views), wanted, atol=1e-5)
    assert torch.equal(doubled(views)[..., ::2, ::2], views)


def test_doubled_views_keep_fine_texture_that_linear_sampling_loses():
    """Against the formula that the views are drawn by, of half the wavelengths."""
    fine = texture(*(2 * np.mgrid[:SIDE_PX, :SIDE_PX][::-1]))
    views = torch.tensor(fine, dtype=torch.float32)[None, None]
    disparity = torch.full((1, 1, SIDE_PX, SIDE_PX), 0.4)
    y, x = np.mgrid[:SIDE_PX, :SIDE_PX]
    wanted = torch.tensor(texture(2 * (x - 0.4), 2 * (y + 0.4)), dtype=torch.float32)
    errors = [
        (sampled(shown, disparity, [(-1.0, 1.0)])[0, 0] - wanted)[3:-3, 3:-3].abs()
        for shown in (views, doubled(views))
    ]
    assert errors[1].mean() < 0.5 * errors[0].mean()


def test_images_are_summed_by_their_weights():
    images, weights = torch.rand(2, 2, 5, 6, 7, generator=torch.Generator().manual_seed(7))
    for given in (weights, weights[:1, :, :1, :1]):
        wanted = (given * images).sum(1, keepdim=True)
        assert torch.allclose(summed(images, given), wanted, atol=1e-6)


@pytest.mark.parametrize("views", [3, 5, 9, 11])
@pytest.mark.parametrize("disparity", [-1.5, 0.0, 1.0])
def test_the_true_plane_costs_least(views, disparity):
    """In every arm; and it costs nothing where it moves the views by whole pixels."""
    unit = OUTERMOST / (views // 2)
    seen = Views(plane(disparity * unit, views))
    tried = [-2.0, -1.5, -0.5, 0.0, 0.5, 1.0, 2.0]
    costs = seen.costs(tried)[0][:, :, :PARTS, 12:-12, 12:-12].mean((0, 3, 4))
    assert (costs.argmin(0) == tried.index(disparity)).all()
    if disparity in (0.0, 1.0) and OUTERMOST % (views // 2) == 0:
        assert costs.amin(0).max() < 1e-5


def test_costs_are_gathered_over_squares():
    """Against torch's poolings, where no border is near."""
    cost = torch.rand(1, 7, 60, 52, generator=torch.Generator().manual_seed(3))
    wide, distinct = gathered(cost)
    assert wide.shape == (1, 7, 2, 60, 52) and distinct.shape == (1, 2, 60, 52)
    small = F.avg_pool2d(cost, 2)
    for k, side in enumerate((3, 9)):
        square = F.avg_pool2d(small, side, stride=1, padding=side // 2)
        unit = square.std(1, keepdim=True)
        relative = (square - square.mean(1, keepdim=True)) / (unit + 0.002)
        for found, wanted in (
            (wide[:, :, k], relative),
            (distinct[:, k : k + 1], 0.3 * torch.log(unit + 1e-4) + 2),
        ):
            enlarged = F.interpolate(wanted, scale_factor=2, mode="bilinear")
            assert torch.allclose(found[INNER], enlarged[INNER], atol=1e-4)


def test_a_faint_plane_stands_out_where_costs_are_gathered():
    """Costs so noisy that no pixel tells its disparity; squares do."""
    noise = torch.randn(1, 17, 64, 48, generator=torch.Generator().manual_seed(4))
    cost = 0.5 + 0.06 * noise
    cost[:, 8] -= 0.03
    wide, _ = gathered(cost)
    right = [(t.argmin(1) == 8)[INNER].float().mean() for t in (cost, *wide.unbind(2))]
    assert right[0] < 0.2 and right[1] > 2 * right[0] and right[2] > 0.99


def _steps(squares: Squares):
    """What each arm (B, 8) asks for."""
    return squares.slopes[INNER].sum((2, 3)) / squares.matches[INNER].sum((2, 3))


@pytest.mark.parametrize("views", [3, 9])
@pytest.mark.parametrize("error", [-0.1, 0.05])
def test_least_squares_ask_for_the_error_of_an_estimate(views, error):
    unit = OUTERMOST / (views // 2)
    seen = Views(plane(0.63 * unit, views))
    estimate = torch.full((1, 1, SIDE_PX, SIDE_PX), 0.63 + error)
    _, *squares = seen.least_squares(estimate, 0.1)
    for of_arms in squares:
        assert _steps(of_arms).numpy() == pytest.approx(-error, abs=0.01)


def test_slopes_of_the_mean_of_all_views_are_not_misled_by_noise():
    """The arms' own slopes, squared, hold their noise, so that they ask for too little."""
    noise = torch.randn(1, 4, 9, 96, 96, generator=torch.Generator().manual_seed(3))
    noise[:, :, 4] = noise[:, :1, 4]  # of the one centre view
    stacks = 0.5 + 0.1 * (plane(0.63, side=96) - 0.5) + 0.01 * noise
    estimate = torch.full((1, 1, 96, 96), 0.63 + 0.1)
    _, own, wide, _ = Views(stacks).least_squares(estimate, 0.1)
    asked = [
        squares.slopes[INNER].sum((1, 2, 3)) / squares.matches[INNER].sum((1, 2, 3))
        for squares in (own, wide)
    ]
    assert -0.05 < asked[0] < 0
    assert asked[1].item() == pytest.approx(-0.1, abs=0.01)


@pytest.mark.parametrize("views", [5, 9])
def test_fine_texture_tells_a_shine_that_moves_with_the_view_from_disparity(views):
    """The light falls off down the picture, and the whole of it darkens from view to view."""
    y = torch.arange(float(SIDE_PX)).view(-1, 1)
    steps = torch.tensor([p for d in DIRECTIONS_DEG for p in direction_positions(d, views)])
    down = (steps[:, 0] - views // 2).view(1, 4, views, 1, 1)
    stacks = 0.05 * plane(0.63, views) + 0.004 * (y + 0.63 * down) - 0.001 * down
    estimate = torch.full((1, 1, SIDE_PX, SIDE_PX), 0.63 / (OUTERMOST / (views // 2)))
    vertical = [k for k, (*_, row, col) in enumerate(ARMS) if row and not col]
    _, _, whole, fine = Views(stacks).least_squares(estimate, 0.1)
    whole_px, fine_px = (_steps(squares)[:, vertical].abs() for squares in (whole, fine))
    assert (fine_px < 0.01).all() and (whole_px > 0.05).all()


@pytest.mark.parametrize(("place", "rows", "cols"), [(0, -4, -4), (12, 0, 0), (14, 0, 4)])
def test_a_refinement_can_choose_the_map_at_a_pixel_nearby(place, rows, cols):
    net = SweepNet().eval()
    disparity = torch.rand(1, 1, SIDE_PX, SIDE_PX, generator=torch.Generator().manual_seed(2))
    context = torch.zeros(1, net.config.context_width, SIDE_PX, SIDE_PX)
    views = torch.full((1, 4, 9, SIDE_PX, SIDE_PX), 0.5)  # no texture: least squares stay still
    with torch.no_grad():
        net.refine[1].out.bias[place - 25] = 30
        refined, _ = net.refine[1](Views(views), disparity, context)
    inner = slice(4, -4)
    moved = disparity.roll((-rows, -cols), (-2, -1))
    assert torch.allclose(refined[..., inner, inner], moved[..., inner, inner])


def test_each_round_refines_the_result_of_the_one_before():
    once = SweepNetConfig(half=replace(SweepNetConfig().half, rounds=1))
    thrice = SweepNetConfig(half=replace(SweepNetConfig().half, rounds=3))
    net = SweepNet(once).eval()
    with torch.no_grad():
        net.refine[0].out.weight.normal_(std=0.01)
        given, made = [], []
        net.refine[0].register_forward_pre_hook(lambda _, args: given.append(args[1]))
        net.refine[0].register_forward_hook(lambda _, args, result: made.append(result[0]))
        maps = net(plane(0.63)).maps
        net.config = thrice
        more = net(plane(0.63)).maps
    assert len(more) == len(maps) + 2
    for one, other in zip(maps[:2], more[:2], strict=True):
        assert torch.equal(one, other)
    assert torch.equal(given[0], given[1])
    for before, result in zip(made[1:], given[2:], strict=False):
        assert torch.equal(before, result)


def test_each_round_at_full_size_refines_the_result_of_the_one_before():
    net = SweepNet(SweepNetConfig(full=replace(SweepNetConfig().full, rounds=3))).eval()
    with torch.no_grad():
        net.refine[1].out.weight.normal_(std=0.01)
        given, made = [], []
        net.refine[1].register_forward_pre_hook(lambda _, args: given.append(args[1]))
        net.refine[1].register_forward_hook(lambda _, args, result: made.append(result[0]))
        maps = net(plane(0.63)).maps
    assert len(given) == 3
    for before, result in zip(made, [*given[1:], maps[-1]], strict=True):
        assert torch.equal(before, result)


def test_an_untrained_refinement_takes_the_least_squares_step():
    net = SweepNet().eval()
    seen = Views(plane(0.63))
    estimate = torch.full((1, 1, SIDE_PX, SIDE_PX), 0.55)
    context = torch.zeros(1, net.config.context_width, SIDE_PX, SIDE_PX)
    with torch.no_grad():
        refined, _ = net.refine[1](seen, estimate, context)
    assert (refined - 0.63)[..., 12:-12, 12:-12].abs().mean() < 0.01


@pytest.mark.parametrize(
    ("views", "size", "range_px"),
    [
        (9, (64, 48), (-4, 4)),
        (5, (37, 41), (-4, 4)),
        (3, (40, 40), (-1, 0.5)),
        (9, (70, 66), (-25, 5)),
    ],
)
def test_any_grid_size_and_range(views, size, range_px):
    net = SweepNet().eval()
    with torch.no_grad():
        made = net(torch.rand(2, 4, views, *size), range_px)
    assert made.maps[-1].shape == made.log_error.shape == (2, 1, *size)
    assert torch.isfinite(made.maps[-1]).all()
    low, high = made.hypotheses[[0, -1]].tolist()
    assert low < range_px[0] and high > range_px[1]
    assert len(made.hypotheses) <= 15


def test_all_maps_of_a_wide_range_are_whole_and_in_px_of_the_views():
    """Those of halved views, too: half of them less would be learned as if it were all."""
    net = SweepNet().eval()
    with torch.no_grad():
        made = net(torch.full((1, 4, 9, 70, 66), 0.5), (-25.0, 5.0))
        net.fill.out.bias[0] += 1
        more = net(torch.full((1, 4, 9, 70, 66), 0.5), (-25.0, 5.0))
    levels, _ = net.hypotheses((-25.0, 5.0), 9)
    half, full = net.config.half.rounds, net.config.full.rounds
    assert len(made.maps) == 1 + half + full * (levels + 1)
    for one, other in zip(made.maps, more.maps, strict=True):
        assert one.shape == (1, 1, 70, 66)
        assert torch.allclose(other - one, torch.tensor(2.0**levels), atol=0.01)


def test_hypotheses_are_in_proportion_to_the_range():
    net = SweepNet().eval()
    stacks = torch.rand(1, 4, 9, 32, 32)
    with torch.no_grad():
        counts = [len(net(stacks, (-r, r)).hypotheses) for r in (1.0, 2.0, 4.0)]
    assert np.diff(counts).tolist() == [2, 4]


def test_another_unit_is_the_same_estimate():
    net = SweepNet().eval()
    with torch.no_grad():
        made = net(torch.rand(1, 4, 3, 32, 32), (-4.0, 4.0))
    halved = made.scaled(0.5)
    assert torch.equal(halved.maps[0], made.maps[0] / 2)
    assert torch.allclose(halved.log_error.exp(), made.log_error.exp() / 2)
    assert torch.equal(halved.hypotheses, made.hypotheses / 2)


def test_cost_and_size_stay_within_bounds():
    """At most 0.6 million multiply-adds per pixel for -4..4 px, and 2 million parameters."""
    from torch.utils.flop_counter import FlopCounterMode

    net = SweepNet().eval()
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        net(torch.rand(1, 4, 9, 128, 128), (-4.0, 4.0))
    assert counter.get_total_flops() / 2 / 128**2 < 0.6e6
    assert sum(p.numel() for p in net.parameters()) < 2e6


def test_an_impossible_input_is_refused():
    for shape in ((1, 3, 9, 32, 32), (1, 4, 8, 32, 32), (4, 9, 32, 32)):
        with pytest.raises(ValueError, match="expected"):
            SweepNet()(torch.zeros(shape))


@pytest.mark.parametrize("wrong", [{"rounds": 0}, {"side": 4}])
def test_an_impossible_refinement_is_refused(wrong):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        replace(SweepNetConfig().half, **wrong)


def test_a_configuration_survives_json():
    import json

    config = SweepNetConfig(half=replace(SweepNetConfig().half, spread_px=0.3))
    assert SweepNetConfig(**json.loads(json.dumps(config_as_dict(SweepNet(config))))) == config
