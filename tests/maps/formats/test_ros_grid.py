"""ROS maps: cells become walls no more than a cell off, in the right place."""

from __future__ import annotations

import gzip
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image, ImageDraw

from albot_core.errors import InputError
from albot_maps import ROBOT_RADIUS, World, load_world
from albot_maps.formats.ros_grid import trace_cells
from albot_maps.freespace import wall_lines

OCCUPIED, FREE, UNKNOWN = 0, 254, 205
DESCRIPTION = {
    "image": "map.pgm",
    "resolution": 0.1,
    "origin": [0.0, 0.0, 0.0],
    "occupied_thresh": 0.65,
    "free_thresh": 0.196,
    "negate": 0,
}


def room() -> np.ndarray:
    """A room of 4 x 2 m inside walls one cell thick, in the picture's row order."""
    picture = np.full((24, 44), UNKNOWN, dtype=np.uint8)
    picture[1:-1, 1:-1] = OCCUPIED
    picture[2:-2, 2:-2] = FREE
    return picture


def write_map(folder: Path, picture: np.ndarray, **changes) -> Path:
    """A map's YAML and its picture."""
    description = DESCRIPTION | changes
    content = b"P5\n# a comment\n%d %d\n255\n" % picture.shape[::-1] + picture.tobytes()
    (folder / "map.pgm").write_bytes(content)
    path = folder / "map.yaml"
    path.write_text("".join(f"{key}: {value}\n" for key, value in description.items()))
    return path


def boundary_edges(occupied: np.ndarray) -> np.ndarray:
    """Every side of a cell between an occupied and another one, found one by one."""
    padded = np.pad(occupied, 1)
    edges = []
    for row, column in np.argwhere(occupied):
        if not padded[row, column + 1]:
            edges.append((column, row, column + 1, row))
        if not padded[row + 2, column + 1]:
            edges.append((column, row + 1, column + 1, row + 1))
        if not padded[row + 1, column]:
            edges.append((column, row, column, row + 1))
        if not padded[row + 1, column + 2]:
            edges.append((column + 1, row, column + 1, row + 1))
    return np.array(edges, dtype=np.float64)


def assert_within_one_cell(occupied: np.ndarray, walls: np.ndarray) -> None:
    edges = boundary_edges(occupied)
    assert_near(walls, edges)
    assert_near(edges, walls)


def assert_near(lines: np.ndarray, others: np.ndarray) -> None:
    """Every point of some lines, one each quarter cell, lies within a cell of the others."""
    points = shapely.points(shapely.get_coordinates(shapely.segmentize(wall_lines(lines), 0.25)))
    tree = shapely.STRtree(shapely.linestrings(others.reshape(-1, 2, 2)))
    near, _ = tree.query(points, predicate="dwithin", distance=1 + 1e-9)
    assert len(np.unique(near)) == len(points)


@settings(max_examples=100, deadline=None)
@given(arrays.arrays(np.bool_, st.tuples(st.integers(1, 12), st.integers(1, 12))))
def test_traced_walls_are_within_one_cell_of_the_cells_and_back(occupied):
    if occupied.any():
        assert_within_one_cell(occupied, trace_cells(occupied, Path("map.pgm")))


@pytest.mark.parametrize("name", ["UMA_236_237", "y4_aaf-cropped"])
def test_real_maps_load_and_keep_the_bound(data, name):
    path = data / "grids" / f"{name}.yaml"
    world = load_world(str(path))
    picture = Image.open(BytesIO(gzip.decompress(path.with_suffix(".pgm.gz").read_bytes())))
    shades = np.asarray(picture)[::-1]
    occupied = 1 - shades / 255 > 0.65
    origin = {"UMA_236_237": (-4.0, -4.0), "y4_aaf-cropped": (-39.85, -77.95)}[name]
    cells = (world.walls.reshape(-1, 2, 2) - origin).reshape(-1, 4) / 0.05
    assert_within_one_cell(occupied, np.round(cells, 6))
    assert wall_lines(world.walls).distance(shapely.Point(world.starts[0, :2])) > 1.0
    column, row = ((world.starts[0, :2] - origin) / 0.05).astype(int)
    assert shades[row, column] == 254


def test_a_room_stands_where_its_cells_are(tmp_path):
    world = load_world(str(write_map(tmp_path, room(), origin=[1.0, 2.0, 0.0])))
    assert world.bounds == pytest.approx((1.1, 2.1, 5.3, 4.3))
    assert world.closed
    assert world.starts[0] == pytest.approx([3.2, 3.2, 0], abs=1.1)
    assert world.name == "map"


def test_the_first_row_of_the_picture_is_the_top(tmp_path):
    picture = room()
    picture[5:8, 38:42] = OCCUPIED
    world = load_world(str(write_map(tmp_path, picture)))
    middle = world.walls.reshape(-1, 2).mean(axis=0)
    corner = world.walls[(np.abs(world.walls - [4.0, 1.75, 4.0, 1.75]) < 0.3).all(axis=1)]
    assert len(corner), middle


def test_an_origin_with_a_heading_turns_the_map(tmp_path):
    straight = load_world(str(write_map(tmp_path, room())))
    turned = load_world(str(write_map(tmp_path, room(), origin=[5.0, 0.0, np.pi / 2])))
    x1, y1, x2, y2 = straight.walls.T
    assert turned.walls == pytest.approx(np.stack((5 - y1, x1, 5 - y2, x2), axis=1))
    x, y = straight.starts[0, :2]
    assert turned.starts[0, :2] == pytest.approx([5 - y, x])


def test_negate_swaps_dark_and_light(tmp_path):
    plain = load_world(str(write_map(tmp_path, room())))
    negated = load_world(str(write_map(tmp_path, 255 - room(), negate=1)))
    assert np.array_equal(plain.walls, negated.walls)


def test_the_threshold_decides_what_is_a_wall(tmp_path):
    picture = room()
    picture[10, 10] = 100  # darkness 0.61
    faint = load_world(str(write_map(tmp_path, picture)))
    dark = load_world(str(write_map(tmp_path, picture, occupied_thresh=0.6)))
    assert len(dark.walls) == len(faint.walls) + 4


def test_a_speck_of_one_cell_is_kept(tmp_path):
    picture = room()
    picture[12, 20] = OCCUPIED
    walls = load_world(str(write_map(tmp_path, picture))).walls
    near = np.abs(walls.reshape(-1, 2, 2).mean(axis=1) - [2.05, 1.15]).max(axis=1) < 0.06
    assert np.count_nonzero(near) == 4


@pytest.mark.parametrize("asked", ["map.yaml", "map.pgm.gz"])
def test_a_gzipped_picture_is_found(tmp_path, asked):
    plain = load_world(str(write_map(tmp_path, room())))
    picture = tmp_path / "map.pgm"
    (tmp_path / "map.pgm.gz").write_bytes(gzip.compress(picture.read_bytes()))
    picture.unlink()
    assert np.array_equal(load_world(str(tmp_path / asked)).walls, plain.walls)


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1"])
def test_png_pictures_of_any_kind(tmp_path, mode):
    plain = load_world(str(write_map(tmp_path, room())))
    path = write_map(tmp_path, room(), image="map.png")
    cleared = np.where(room() == UNKNOWN, FREE, room()) if mode == "1" else room()
    Image.fromarray(cleared).convert(mode).save(tmp_path / "map.png")
    assert np.array_equal(load_world(str(path)).walls, plain.walls)
    assert np.array_equal(load_world(str(tmp_path / "map.png")).walls, plain.walls)


@pytest.mark.parametrize(
    ("changes", "place", "words"),
    [
        ({"image": "elsewhere.pgm"}, "line 1, image", "a picture that exists"),
        ({"image": "."}, "line 1, image", "a picture that exists, found ."),
        ({"image": "/"}, "line 1, image", "a picture that exists, found /"),
        ({"image": "''"}, "line 1, image", "a picture that exists, found ''"),
        ({"image": 3}, "line 1, image", "the name of a picture"),
        ({"resolution": 0}, "line 2, resolution", "a positive length"),
        ({"resolution": ".nan"}, "line 2, resolution", "a number"),
        ({"resolution": "fine"}, "line 2, resolution", "found fine"),
        ({"origin": [0, 0]}, "line 3, origin", "3 numbers"),
        ({"occupied_thresh": 65}, "line 4, occupied_thresh", "from 0 to 1"),
        (
            {"occupied_thresh": 0.1, "free_thresh": 0.9},
            "line 5, free_thresh",
            "at most occupied_thresh, 0.1, found 0.9",
        ),
        ({"negate": 2}, "line 6, negate", "0 or 1"),
        ({"negate": [0]}, "line 6, negate", "0 or 1"),
        ({"mode": "raw"}, "line 7, mode", "trinary or scale"),
    ],
)
def test_a_wrong_description_is_named_with_its_line(tmp_path, changes, place, words):
    path = write_map(tmp_path, room(), **changes)
    with pytest.raises(InputError, match=words) as caught:
        load_world(str(path))
    assert caught.value.place == place
    assert caught.value.source == str(path)


def test_a_missing_key_is_named(tmp_path):
    path = write_map(tmp_path, room())
    path.write_text(path.read_text().replace("negate: 0\n", ""))
    with pytest.raises(InputError, match="negate: expected 0 or 1, found no such key"):
        load_world(str(path))


def test_a_picture_without_description_says_what_it_lacks(tmp_path):
    write_map(tmp_path, room()).unlink()
    with pytest.raises(InputError, match=r"its map_server description map.yaml in the same folder"):
        load_world(str(tmp_path / "map.pgm"))


def test_willow_has_no_description(data):
    with pytest.raises(InputError, match=r"willow-full.yaml in the same folder"):
        load_world(str(data / "grids" / "willow-full.pgm"))


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        (np.full((24, 44), FREE, dtype=np.uint8), "at least one occupied cell"),
        (np.full((24, 44), OCCUPIED, dtype=np.uint8), "room for a robot"),
    ],
)
def test_a_map_must_hold_walls_and_room(tmp_path, picture, words):
    with pytest.raises(InputError, match=words):
        load_world(str(write_map(tmp_path, picture)))


@pytest.mark.parametrize("content", [b"", b"P5\n44 24\n255\nabc", b"no picture at all", b"P5\n44"])
def test_a_torn_picture_is_an_error(tmp_path, content):
    path = write_map(tmp_path, room())
    (tmp_path / "map.pgm").write_bytes(content)
    with pytest.raises(InputError, match="an intact PGM or PNG image"):
        load_world(str(path))


def test_a_picture_of_sixteen_bits_is_read(tmp_path):
    plain = load_world(str(write_map(tmp_path, room())))
    path = write_map(tmp_path, room(), image="map.png")
    Image.fromarray(room().astype(np.uint16) * 257).save(tmp_path / "map.png")
    assert np.array_equal(load_world(str(path)).walls, plain.walls)


def test_a_picture_at_the_path_of_another_machine_is_found_beside_the_file(tmp_path):
    plain = load_world(str(write_map(tmp_path, room())))
    world = load_world(str(write_map(tmp_path, room(), image="/home/robot/maps/map.pgm")))
    assert np.array_equal(world.walls, plain.walls)
    assert plain.notes == ()
    assert world.notes == ("/home/robot/maps/map.pgm is missing; used map.pgm",)


# Where robots start. The maps are white outside their walls, as race tracks are and what was
# made black and white.


def drawing(width: float, height: float) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """A white map (m), and what draws on it in cells of 0.1 m."""
    image = Image.new("L", (round(10 * width), round(10 * height)), 255)
    return image, ImageDraw.Draw(image)


def load_drawing(folder: Path, image: Image.Image, **changes: object) -> World:
    return load_world(str(write_map(folder, np.asarray(image), **changes)))


def ring() -> Image.Image:
    """A lane 3 m wide round an infield with a radius of 5 m, on 30 m by 30 m."""
    image, draw = drawing(30, 30)
    for radius in (50, 80):
        draw.ellipse((150 - radius, 150 - radius, 150 + radius, 150 + radius), outline=0, width=3)
    return image


def test_on_a_race_track_the_start_is_on_the_lane(tmp_path):
    world = load_drawing(tmp_path, ring())
    assert 5.3 < np.hypot(*(world.starts[0, :2] - 15)) < 7.7
    assert world.closed
    assert world.notes == ()


@pytest.mark.parametrize(("home", "low", "high"), [((15, 15), 0, 4.7), ((21.5, 15), 5.3, 7.7)])
def test_the_start_is_where_the_frame_of_the_map_begins(tmp_path, home, low, high):
    world = load_drawing(tmp_path, ring(), origin=[-home[0], -home[1], 0.0])
    assert low <= np.hypot(*(world.starts[0, :2] + home - 15)) < high


def test_a_frame_that_begins_outside_changes_nothing(tmp_path):
    world = load_drawing(tmp_path, ring(), origin=[-1.0, -1.0, 0.0])
    assert 5.3 < np.hypot(*(world.starts[0, :2] - 14)) < 7.7


def test_a_building_with_an_open_door_is_started_in_not_its_closet(tmp_path):
    image, draw = drawing(40, 30)
    draw.rectangle((50, 50, 350, 250), outline=0, width=2)
    draw.rectangle((50, 50, 62, 62), outline=0, width=2)  # the closet
    draw.rectangle((340, 140, 360, 155), fill=255)  # the door
    world = load_drawing(tmp_path, image)
    x, y = world.starts[0, :2]
    assert 6.5 < x < 34
    assert 6.5 < y < 24
    assert not world.closed
    assert world.notes == ("no walls enclose the start: a robot can leave the map",)


def test_a_room_within_a_building_that_is_open_is_good_ground(tmp_path):
    image, draw = drawing(40, 30)
    draw.rectangle((50, 50, 350, 250), outline=0, width=2)
    draw.rectangle((50, 50, 170, 170), outline=0, width=2)
    draw.rectangle((340, 140, 360, 155), fill=255)
    world = load_drawing(tmp_path, image)
    assert world.closed
    assert world.notes == ()


def test_islands_in_the_open_are_started_among(tmp_path):
    image, draw = drawing(40, 40)
    for x, y in ((150, 150), (250, 150), (150, 250), (250, 250)):
        draw.rectangle((x, y, x + 10, y + 10), fill=0)
    world = load_drawing(tmp_path, image)
    assert (np.abs(world.starts[0, :2] - 20.5) < 5).all()
    assert len(world.notes) == 1


def test_the_start_is_well_within_the_hull_of_the_islands(tmp_path):
    """The place furthest from all three is on the line between two of them."""
    image, draw = drawing(60, 60)
    for x, y in ((150, 450), (450, 450), (150, 150)):
        draw.rectangle((x - 2, y - 2, x + 2, y + 2), fill=0)
    x, y = load_drawing(tmp_path, image).starts[0, :2] - 15
    assert x > 4
    assert y > 4
    assert x + y < 24


def test_a_single_island_is_started_beside(tmp_path):
    image, draw = drawing(40, 40)
    draw.rectangle((150, 150, 160, 160), fill=0)
    world = load_drawing(tmp_path, image)
    x, y = world.starts[0, :2]
    assert 14 < x < 17.1
    assert 22.9 < y < 26


def test_a_hole_that_no_robot_passes_is_no_way_out(tmp_path):
    image, draw = drawing(20, 20)
    draw.rectangle((50, 50, 150, 150), outline=0, width=2)
    draw.rectangle((145, 100, 155, 103), fill=255)
    world = load_drawing(tmp_path, image)
    assert world.notes == ()
    assert (np.abs(world.starts[0, :2] - 10) < 5).all()


def test_a_floor_that_is_nowhere_free_is_started_on_all_the_same(tmp_path):
    picture = np.where(room() == FREE, UNKNOWN, room()).astype(np.uint8)
    world = load_world(str(write_map(tmp_path, picture)))
    assert world.closed
    assert world.notes == ("no cell is free; the start is on unknown ones",)


@settings(max_examples=40, deadline=None)
@given(arrays.arrays(np.bool_, st.tuples(st.integers(4, 14), st.integers(4, 14))), st.data())
def test_a_start_is_on_ground_that_robots_reach(tmp_path_factory, occupied, data):
    """Patches of 0.8 m, so that robots fit between them or do not."""
    free = data.draw(arrays.arrays(np.bool_, occupied.shape))
    picture = np.where(occupied, OCCUPIED, np.where(free, FREE, UNKNOWN)).astype(np.uint8)
    picture = picture.repeat(8, axis=0).repeat(8, axis=1)
    folder = tmp_path_factory.mktemp("map")
    try:
        world = load_world(str(write_map(folder, picture)))
    except InputError as error:
        assert "free cells with room" in str(error) or "at least one occupied" in str(error)
        return
    assert world.reaches(world.starts[0, :2])
    assert wall_lines(world.walls).distance(shapely.Point(world.starts[0, :2])) > ROBOT_RADIUS
