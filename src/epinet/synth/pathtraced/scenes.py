"""The scenes: what stands where. Each is a fixed arrangement; the pile is drawn from a seed."""

from __future__ import annotations

from collections.abc import Callable

from epinet.synth.pathtraced.elements import (
    BRASS,
    GLASS,
    MIRROR,
    STEEL,
    THIN_GLASS,
    Ball,
    Box,
    Element,
    Finish,
    Lamp,
    Model,
    Panel,
    Rod,
    Scene,
    covered,
    paint,
)
from epinet.synth.pathtraced.pile import pile

_UP = (0.0, 1.0, 0.0)
_OAK = covered("textures/light-wood.png")


def _floor(finish: Finish, side: float = 6000.0) -> Panel:
    return Panel(side, side, (0, 0, 0), finish, _UP)


def _wall(finish: Finish, z: float, side: float = 6000.0) -> Panel:
    return Panel(side, side, (0, side / 2 - side / 4, z), finish)


def _side_wall(finish: Finish, x: float, side: float = 6000.0) -> Panel:
    inwards = (-1.0, 0.0, 0.0) if x > 0 else (1.0, 0.0, 0.0)
    return Panel(side, side, (x, side / 2 - side / 4, 0), finish, inwards)


def still_life() -> Scene:
    """Food and kitchenware on a wooden table before a brick wall."""
    things: tuple[Element, ...] = (
        Box((1700, 40, 1000), 0, 0, covered("textures/wood-tiles.png", 3, 2), y=-40),
        _wall(covered("textures/white-bricks.png", 7), -480),
        Model("teddyBear", 290, -290, -190, turn=25),
        Model("kitchenaid", 360, 210, -200, turn=-150, finishes={"Kitchenaid_Glass": STEEL}),
        Model("tetrapak", 240, -55, -170, turn=20),
        Model("yogurtBottle", 200, 60, -50),
        Model("bread", 230, -60, 120, turn=15),
        Model("cupcake", 120, 165, 130),
        Model("caffe_final", 160, -285, 130, turn=40),
        Model("beerGlass", 170, 345, 60, turn=-40, finishes={"*": THIN_GLASS}),
        Ball(38, 40, 250, covered("textures/lemon.png")),
        Ball(35, 115, 275, covered("textures/lemon.png")),
    )
    lamps = (
        Lamp(1100, 1100, (-900, 1100, 700), (0, 0, 0), (3.6, 3.4, 3.1)),
        Lamp(800, 900, (1300, 700, 500), (0, 100, 0), (1.5, 1.7, 2)),
    )
    return Scene(
        "still_life", still_life.__doc__ or "", things + lamps, (0, 430, 1150), (15, 80, -40)
    )


def toys() -> Scene:
    """Toys on a wooden floor, posters on the wall."""
    things: tuple[Element, ...] = (
        _floor(covered("textures/wood-varnished-panels.png", 5)),
        _wall(covered("textures/pink-plaster.png", 4), -800),
        Panel(520, 520, (-430, 480, -796), covered("photos/astronaut.png")),
        Panel(600, 400, (330, 520, -796), covered("photos/chelsea.png")),
        Model("caballito", 620, 430, -470, turn=-30),
        Model("teddyBear", 400, -110, -440, turn=-10),
        Model("cartoon_biplane", 520, -540, -330, turn=35),
        Model("basketball", 240, -230, 20),
        Model("woodToy", 280, 130, -60, turn=10),
        Model("chicken", 330, 460, 30, turn=-120),
        Model("housePuzzle", 230, -40, 250, turn=20),
        Model("motorbike", 300, -450, 210, turn=60),
        Box((120, 120, 120), 230, 260, covered("photos/coffee.png"), turn=30),
        Box((90, 90, 90), 225, 255, covered("textures/blue-wood.png"), turn=-5, y=120),
    )
    lamps = (
        Lamp(1500, 900, (-300, 2200, 700), (0, 0, -300), (7, 6.8, 6.4)),
        Lamp(500, 500, (1500, 900, 900), (0, 200, 0), (5, 4, 3)),
    )
    return Scene(
        "toys", toys.__doc__ or "", things + lamps, (0, 780, 1650), (0, 170, -150), exposure=1.7
    )


def mirrors() -> Scene:
    """A mirror, metal and glass among textured things."""
    things: tuple[Element, ...] = (
        _floor(covered("textures/wood-tiles.png", 8)),
        _wall(covered("textures/brass-ambra.png", 3), -700),
        _side_wall(covered("textures/blue-wood.png", 4), -1100),
        Panel(5000, 2500, (0, 1250, 2300), covered("photos/rocket.jpg", 2, 1), (0, 0, -1)),
        Panel(560, 640, (120, 420, -640), MIRROR, (-0.1, -0.1, 1)),
        Box((620, 100, 80), 120, -650, covered("textures/dark-wood.png")),
        Model("stoneLantern", 480, -430, -330, turn=30),
        Model("horse2", 430, 480, -300, turn=-60),
        Ball(120, -120, -150, MIRROR),
        Ball(85, 160, -60, GLASS),
        Ball(70, -20, 190, BRASS),
        Model("beerGlass", 190, -300, 140, turn=60, finishes={"*": THIN_GLASS}),
        Model("coffeeBrewer", 260, 390, 20, turn=-40),
        Ball(60, 235, 240, STEEL),
        Box((200, 26, 140), -210, 330, covered("photos/rocket.jpg"), turn=20),
        Box((170, 24, 120), -205, 325, covered("photos/retina.jpg"), turn=-8, y=26),
    )
    lamps = (
        Lamp(1700, 1700, (-600, 1700, 900), (0, 0, -200), (2.6, 2.5, 2.3)),
        Lamp(1000, 1200, (1400, 800, 500), (0, 100, -200), (2, 2.2, 2.5)),
    )
    return Scene(
        "mirrors",
        mirrors.__doc__ or "",
        things + lamps,
        (60, 600, 1450),
        (20, 170, -150),
        exposure=1.6,
    )


def thin() -> Scene:
    """Thin structures: a railing, plants, chairs and a grid of wires."""
    wire = Finish("plastic", (0.12, 0.25, 0.12), roughness=0.15)
    bars = tuple(Rod((x, 0, 520), (x, 900, 520), 4, wire) for x in range(180, 901, 72))
    cross = tuple(Rod((180, y, 520), (900, y, 520), 4, wire) for y in range(40, 900, 72))
    things: tuple[Element, ...] = (
        _floor(covered("textures/dirt.png", 6)),
        _wall(covered("textures/clay.png", 5), -1100),
        Model("fence", 1900, -150, -700, finishes={"*": Finish("plastic", (0.1, 0.1, 0.12))}),
        Model("antiqueChair", 900, -480, 60, turn=40),
        Model("thonet", 800, 400, -130, turn=-30),
        Model("plant", 900, 0, -330),
        Model("decorativePlant", 800, -800, -350),
        Model("orchids", 480, -60, 380, turn=30),
        Model("tableFan", 480, 560, 250, turn=-25),
    )
    lamps = (
        Lamp(1400, 1000, (-1300, 2400, 1300), (0, 300, 0), (9, 8.6, 8)),
        Lamp(600, 1200, (1700, 1100, 900), (0, 300, -200), (3, 3.3, 4)),
    )
    return Scene(
        "thin",
        thin.__doc__ or "",
        things + bars + cross + lamps,
        (0, 820, 2350),
        (0, 380, -100),
        ambient=(0.35, 0.38, 0.42),
        exposure=3.0,
        disparity_px=(-1.8, 2.4),
    )


def plain() -> Scene:
    """Untextured walls and furniture under soft light."""
    things: tuple[Element, ...] = (
        _floor(paint(0.55, 0.52, 0.48), 9000),
        _wall(paint(0.62, 0.68, 0.7), -1500, 9000),
        _side_wall(paint(0.72, 0.55, 0.45), -1900, 9000),
        Box((500, 2600, 500), 1250, -1250, paint(0.7, 0.7, 0.66)),
        Model("sofa2", 1900, -280, -960, turn=12),
        Model("designChair", 850, 1080, -300, turn=-35),
        Model("deer", 480, 80, -250, turn=35, y=400),
        Model("stool", 800, 300, 250),
        Model("dustbin", 500, -620, 300),
        Ball(180, -150, 450, paint(0.7, 0.62, 0.3)),
        Box((900, 60, 550), 250, -250, paint(0.35, 0.42, 0.55), y=340, turn=8),
        Box((80, 340, 400), 0, -250, paint(0.35, 0.42, 0.55), turn=8),
        Box((80, 340, 400), 500, -250, paint(0.35, 0.42, 0.55), turn=8),
    )
    lamps = (
        Lamp(2400, 1600, (300, 3200, 1200), (0, 0, -400), (6, 5.8, 5.4)),
        Lamp(900, 1600, (-1800, 1500, 900), (0, 400, -600), (3, 3.4, 4)),
    )
    return Scene(
        "plain",
        plain.__doc__ or "",
        things + lamps,
        (150, 1350, 3300),
        (0, 480, -350),
        disparity_px=(-1.6, 2.0),
    )


def heap() -> Scene:
    """A heap of boxes, crates, stones and balls, placed by a seed."""
    things: tuple[Element, ...] = (
        _floor(covered("photos/gravel.png", 6)),
        _wall(covered("textures/green-wood.png", 5), -1300),
        *pile(seed=7),
    )
    lamps = (Lamp(1500, 1500, (-1400, 2600, 1000), (0, 0, -200), (9, 8.4, 7.4)),)
    return Scene(
        "heap",
        heap.__doc__ or "",
        things + lamps,
        (100, 1150, 2100),
        (0, 190, -170),
        ambient=(0.45, 0.5, 0.6),
        exposure=1.8,
    )


def shelf() -> Scene:
    """A shelf seen from the side, full of books and small things."""
    boards = tuple(Box((1500, 30, 320), 0, 0, _OAK, y=y) for y in (0.0, 400.0, 800.0))
    sides = tuple(Box((30, 1230, 320), x, 0, _OAK) for x in (-765.0, 765.0))
    covers = (
        "textures/red-wood.png",
        "textures/green-wood.png",
        "photos/hubble_deep_field.jpg",
        "textures/gray-felt.png",
        "textures/yellow-plaster.png",
        "photos/rocket.jpg",
        "textures/blue-wood.png",
    )
    books = tuple(
        Box((44, 250 + 17 * (i % 4), 200), -700 + 50 * i, 20 + 12 * (i % 3), covered(cover), y=430)
        for i, cover in enumerate(covers)
    )
    low_books = tuple(
        Box((52, 230 + 20 * (i % 3), 190), 460 + 58 * i, 10 * i, covered(cover), y=30)
        for i, cover in enumerate(reversed(covers[:5]))
    )
    things: tuple[Element, ...] = (
        _wall(covered("textures/cream-plaster.png", 4), -170),
        Model("JapaneseLantern", 300, -560, 20, y=30),
        Model("handbag", 330, -150, 20, y=30, turn=-15),
        Model("headphones", 230, 220, 20, y=30, turn=30),
        Model("cactus", 320, -180, 20, y=430),
        Model("teddyBear", 300, 130, 10, y=430, turn=-10),
        Model("speaker3", 330, 560, 0, y=430, turn=-12),
        Model("cupcake", 130, 350, 70, y=430),
        Model("lantern", 330, -530, 0, y=830),
        Model("rock1", 230, -180, 20, y=830, turn=40),
        Model("kalender", 240, 150, 20, y=830, turn=-20),
        Model("littlePlant", 330, 520, 0, y=830),
    )
    lamps = (
        Lamp(900, 1400, (-1300, 1300, 1600), (0, 600, 0), (7, 6.6, 6)),
        Lamp(700, 700, (1600, 1500, 1300), (0, 500, 0), (5, 5.2, 5.6)),
    )
    return Scene(
        "shelf",
        shelf.__doc__ or "",
        boards + sides + books + low_books + things + lamps,
        (-950, 800, 1500),
        (-110, 520, 0),
        ambient=(0.3, 0.3, 0.3),
        disparity_px=(-2.0, 2.2),
    )


def corner() -> Scene:
    """The corner of a room with posters, furniture and shining metal."""
    things: tuple[Element, ...] = (
        _floor(covered("textures/light-gray-floor-tile.png", 8)),
        _wall(covered("textures/gray-plaster.png", 3), -1200),
        _side_wall(covered("textures/yellow-plaster.png", 3), 1300),
        Panel(700, 610, (-500, 1250, -1196), covered("photos/hubble_deep_field.jpg")),
        Panel(560, 560, (500, 1200, -1196), covered("photos/astronaut.png")),
        Panel(900, 600, (1296, 1150, -500), covered("photos/coffee.png"), (-1, 0, 0)),
        Model("bedsideTable2", 620, -750, -820, turn=15),
        Model("winchesterArmchair", 980, 650, -650, turn=-35),
        Model("stool2", 700, -120, -420),
        Model("tableFan", 420, -120, -420, y=700, turn=20),
        Model("barrel", 620, -730, 130),
        Model("kitchenaid", 380, -730, 130, y=620, turn=-120, finishes={"Kitchenaid_Glass": STEEL}),
        Model("fireExtinguisher", 560, 230, 100, turn=-30),
        Ball(170, 620, 250, STEEL),
        Box((420, 300, 300), -160, 330, covered("textures/steel-scratched.png"), turn=25),
        Box((240, 180, 200), -150, 320, covered("textures/red-wood.png"), turn=-12, y=300),
    )
    lamps = (
        Lamp(1000, 1000, (-200, 2900, 300), (0, 0, -200), (9, 8.2, 7)),
        Lamp(500, 1300, (-1900, 1300, 1200), (0, 500, -300), (4, 4.6, 6)),
    )
    return Scene(
        "corner",
        corner.__doc__ or "",
        things + lamps,
        (-300, 1350, 2500),
        (0, 560, -250),
        exposure=1.9,
        disparity_px=(-1.8, 2.2),
    )


SCENES: dict[str, Callable[[], Scene]] = {
    make.__name__: make for make in (still_life, toys, mirrors, thin, plain, heap, shelf, corner)
}
