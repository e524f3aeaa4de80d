"""The four directions and what symmetries do to them."""

import numpy as np
import pytest
import torch

from epinet.angular import (
    DIRECTIONS_DEG,
    SYMMETRIES,
    Symmetry,
    direction_positions,
    gather_stacks,
    star_positions,
)


def hci_indices(direction_deg: int) -> list[int]:
    return [9 * row + col for row, col in direction_positions(direction_deg, 9)]


def test_directions_are_the_reference_implementations():
    assert hci_indices(90) == [76, 67, 58, 49, 40, 31, 22, 13, 4]
    assert hci_indices(0) == [36, 37, 38, 39, 40, 41, 42, 43, 44]
    assert hci_indices(45) == [72, 64, 56, 48, 40, 32, 24, 16, 8]
    assert hci_indices(-45) == [0, 10, 20, 30, 40, 50, 60, 70, 80]


@pytest.mark.parametrize("views", [3, 5, 7, 9])
def test_fewer_views_drop_the_same_number_at_each_end(views):
    drop = (9 - views) // 2
    for direction in DIRECTIONS_DEG:
        whole = direction_positions(direction, 9)[drop : drop + views]
        assert [(r - drop, c - drop) for r, c in whole] == direction_positions(direction, views)
    assert len(star_positions(views)) == 4 * views - 3


# The paper's figure 5 and the flips, for stacks (90, 0, 45, -45); "~" is reversed view order.
CONNECTIONS = {
    Symmetry(1): ("0", "~90", "-45", "~45"),
    Symmetry(2): ("~90", "~0", "~45", "~-45"),
    Symmetry(3): ("~0", "90", "~-45", "45"),
    Symmetry(0, True): ("~0", "~90", "~45", "-45"),
    Symmetry(3, True): ("90", "~0", "~-45", "~45"),  # left-right
    Symmetry(1, True): ("~90", "0", "-45", "45"),  # up-down
}


@pytest.mark.parametrize("symmetry", CONNECTIONS, ids=str)
def test_streams_are_reconnected_as_published(symmetry):
    text = [("~" if rev else "") + str(DIRECTIONS_DEG[i]) for i, rev in symmetry.stack_sources()]
    assert tuple(text) == CONNECTIONS[symmetry]


@pytest.mark.parametrize("symmetry", SYMMETRIES, ids=str)
def test_turned_stacks_equal_stacks_of_the_turned_light_field(symmetry):
    """Independent reference: turn the whole 5-d array with numpy, view grid and images alike."""
    views = np.random.default_rng(0).random((5, 5, 6, 8), dtype=np.float32)
    stacks = gather_stacks(lambda r, c: views[r, c], 5)
    if symmetry.transposed:
        views = views.transpose(1, 0, 3, 2)
    views = np.rot90(
        np.rot90(views, symmetry.quarter_turns, (0, 1)), symmetry.quarter_turns, (2, 3)
    )
    expected = gather_stacks(lambda r, c: views[r, c], 5)
    turned = symmetry.apply_to_stacks(torch.from_numpy(stacks))
    np.testing.assert_array_equal(turned.numpy(), expected)


@pytest.mark.parametrize("symmetry", SYMMETRIES, ids=str)
def test_undo_reverses_apply(symmetry):
    image = np.arange(12.0).reshape(3, 4)
    np.testing.assert_array_equal(symmetry.undo(symmetry.apply(image)), image)
    tensor = torch.from_numpy(image)
    assert torch.equal(symmetry.undo(symmetry.apply(tensor)), tensor)
    np.testing.assert_array_equal(symmetry.apply(tensor).numpy(), symmetry.apply(image))


def test_four_quarter_turns_and_two_transpositions_are_the_identity():
    stacks = torch.rand(2, 4, 7, 10, 12)
    turned = stacks
    for _ in range(4):
        turned = Symmetry(1).apply_to_stacks(turned)
    assert torch.equal(turned, stacks)
    twice = Symmetry(0, True).apply_to_stacks(Symmetry(0, True).apply_to_stacks(stacks))
    assert torch.equal(twice, stacks)
