"""Stage worlds: bitmaps and boxes in their place, and what is passed over or refused."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from PIL import Image

from albot_core.errors import InputError
from albot_maps import load_world
from albot_maps.freespace import wall_lines

MAP_INC = """
define floorplan model ( color "gray30" boundary 1 gui_nose 0 obstacle_return 1 )
define crate model ( size [1 0.5 0.5] )
define robot position ( size [0.4 0.4 0.2] ranger ( pose [0 0 0 0] ) )
"""
WORLD = """
# a world
include "map.inc"
include "gone.inc"
resolution 0.02  # metres
window ( size [ 600 400 ] center [-7.01 5.96] )
floorplan ( name "plan" bitmap "bitmaps/room.png" size [8 4 1] pose [1 2 0 0] )
crate ( pose [1 2 0 90] )
robot ( pose [0 0 0 0] name "r0" )
chair ( pose [0 0 0 0] )
"""
PLACE = "a.world, line 2, bitmap: expected"


@pytest.fixture
def folder(tmp_path):
    """A room 80 x 40 pixels with walls 2 pixels thick, 10 pixels from the picture's edge."""
    pixels = np.full((60, 100), 255, dtype=np.uint8)
    pixels[10:50, 10:90] = 0
    pixels[12:48, 12:88] = 200
    (tmp_path / "bitmaps").mkdir()
    Image.fromarray(pixels).save(tmp_path / "bitmaps" / "room.png")
    (tmp_path / "map.inc").write_text(MAP_INC)
    (tmp_path / "a.world").write_text(WORLD)
    return tmp_path


def read(folder, text=None):
    if text is not None:
        (folder / "a.world").write_text(text)
    return load_world(str(folder / "a.world"))


def test_a_bitmap_with_a_boundary_is_stretched_by_its_edge(folder):
    world = read(folder)
    assert world.bounds == pytest.approx((-3, 0, 5, 4))
    # The room's inner side lies 12 of 100 pixels from the left of 8 m.
    inner = wall_lines(world.walls)
    assert inner.distance(shapely.Point(-3 + 8 * 12 / 100, 2)) < 0.01
    assert world.closed


def test_a_bitmap_without_a_boundary_is_stretched_by_its_dark_pixels(folder):
    world = read(folder, WORLD.replace('include "map.inc"', ""))
    assert world.bounds == pytest.approx((-3, 0, 5, 4))
    assert wall_lines(world.walls).distance(shapely.Point(-3 + 8 * 2 / 80, 2)) < 0.01


def test_a_box_is_turned_and_what_is_unknown_is_noted(folder):
    world = read(folder)
    corners = {tuple(point) for point in world.walls[-4:, :2].round(6).tolist()}
    assert corners == {(0.75, 1.5), (1.25, 1.5), (1.25, 2.5), (0.75, 2.5)}
    assert world.notes == (
        "missing include: gone.inc",
        "skipped (unknown or not an obstacle): 1 window, 1 robot, 1 chair",
    )
    x, y, heading = world.starts[0]
    assert -3 < x < 5
    assert 0 < y < 4
    assert heading == 0


def test_blocks_and_old_poses(folder):
    block = "block( points 3 point[0] [0 0] point[1] [2 0] point[2] [0 2] z [0 1] )"
    text = f"model ( size [4 4] pose [0 0 45] {block} )"
    world = read(folder, text)
    assert len(world.walls) == 3
    lengths = np.hypot(*(world.walls[:, 2:] - world.walls[:, :2]).T)
    assert sorted(lengths) == pytest.approx([4, 4, 4 * 2**0.5])
    assert world.walls[0, :2] == pytest.approx([0, -(8**0.5)])


def test_the_bitmap_may_lie_beside_the_file(folder):
    (folder / "bitmaps" / "room.png").rename(folder / "room.png")
    world = read(folder)
    assert any("is missing; used room.png" in note for note in world.notes)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "a.world: expected a floorplan or a model that is an obstacle, found none"),
        ("window ( )", "a floorplan or a model that is an obstacle"),
        (
            "model ( obstacle_return 0 ranger_return -1 )",
            "an obstacle, found none (skipped (unknown or not an obstacle): 1 model)",
        ),
        (
            'include "gone.inc"\ncrate ( pose [0 0 0 0] )',
            "found none (missing include: gone.inc; skipped (unknown or not an obstacle): 1 crate)",
        ),
        (
            "\nfloorplan ( obstacle_return 0 ranger_return -1 )\nmodel ( )",
            "line 2: expected a floor plan that robots touch or rangers see, "
            "found floorplan with obstacle_return 0 and ranger_return -1",
        ),
        (
            '\nmap ( bitmap "bitmaps/room.png" obstacle_return 0 laser_return 0 )\nmodel ( )',
            "found map with obstacle_return 0 and laser_return 0",
        ),
        ("model ( pose [0 0 1.2.3] )", "line 1: expected pose with 3 or 4 numbers"),
        ("floorplan (", "end of the file: expected a ) for the ( of line 1"),
        ("size [1 2", "end of the file: expected ]"),
        ("size", "end of the file: expected a value"),
        ("size )", "line 1: expected a value, found ')'"),
        ("\n; 3", "line 2: expected Stage's syntax, found ';'"),
        ("3", "line 1: expected a model or a property, found '3'"),
        ("define a b 3", "line 1: expected (, found '3'"),
        ("model ( size [1 a] )", "line 1: expected size with 2 or 3 numbers"),
        ("model ( size [-1 1] )", "line 1: expected a size larger than 0"),
        ("model ( pose [1 2] )", "line 1: expected pose with 3 or 4 numbers"),
        ("include 3", "line 1: expected the name of a file"),
        ('\ninclude "."', "a.world, line 2, include: expected a file, not a folder, found '.'"),
        ('include ""', "a.world, line 1, include: expected a file, not a folder, found ''"),
        *(
            (f'\nfloorplan ( bitmap "{name}" )', f"{PLACE} a picture that exists, found '{name}'")
            for name in ("no.png", "", ".", "bitmaps")
        ),
        ('floorplan ( bitmap "a.world" )', "a.world: expected an intact PGM or PNG image"),
        ("model ( block ( points 1 point[0] [0 0] ) )", "line 1: expected 3 points or more"),
        ("model (" * 60, "expected models nested 50 deep at most"),
        ('include "a.world"', "expected files included 50 deep at most"),
    ],
)
def test_what_is_wrong_is_named(folder, text, words):
    with pytest.raises(InputError) as caught:
        read(folder, text)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


SEEN = """
define floorplan model ( color "gray30" gui_nose 0 boundary 1 ranger_return 0.5 obstacle_return 0 )
define zone model ( size [4 4 0.02] obstacle_return 0 ranger_return -1 )
define base position ( drive "diff" origin [-0.04 0 0 0] )
define robot base ( model ( size [0.1 0.1 0.1] pose [0.2 0 0 0] ) )
floorplan ( bitmap "bitmaps/room.png" size [10 6 0.8] )
zone ( pose [1 1 0 0] ctrl "source 1" )
robot ( pose [2 1 0 45] )
"""
"""What Stage's stock includes say of floor plans: robots drive through, rangers see them."""
ONLY_SEEN = "walls, because rangers see them (obstacle_return 0): 1 floorplan"


def test_walls_that_rangers_see_are_walls(folder):
    world = read(folder, SEEN)
    solid = read(folder, SEEN.replace("obstacle_return 0 )\ndefine zone", ")\ndefine zone"))
    assert np.array_equal(world.walls, solid.walls)
    skipped = "skipped (unknown or not an obstacle): 1 zone, 1 robot"
    assert world.notes == (ONLY_SEEN, skipped)
    assert solid.notes == (skipped,)
    assert not world.glass.any()


def test_a_building_is_kept_beside_its_furniture(folder):
    world = read(folder, SEEN + "model ( pose [3 1 0 0] size [1 1 0.7] )")
    assert world.bounds == pytest.approx((-5, -3, 5, 3))
    assert not (2.4 < world.starts[0, 0] < 3.6 and 0.4 < world.starts[0, 1] < 1.6)


def test_a_bitmap_of_a_type_that_is_defined_nowhere_is_a_floor_plan(folder):
    plan = 'include "gone.inc"\nmap ( bitmap "bitmaps/room.png" size [10 6] )\n'
    world = read(folder, plan + "model ( pose [3 1 0] size [1 1] )\nprop ( pose [0 0 0] )")
    assert world.bounds == pytest.approx((-5, -3, 5, 3))
    assert world.notes == (
        "missing include: gone.inc",
        "not defined, taken for floor plans because of their bitmaps: 1 map",
        "skipped (unknown or not an obstacle): 1 prop",
    )


@pytest.mark.parametrize("unseen", ["ranger_return -1", "laser_return 0"])
def test_what_robots_touch_and_rangers_do_not_see_is_glass(folder, unseen):
    world = read(folder, f"{WORLD}\nmodel ( pose [3 3 0 0] size [0.5 0.5 1] {unseen} )")
    assert world.glass.tolist() == [False] * (len(world.walls) - 4) + [True] * 4


@pytest.mark.parametrize(
    "mark",
    [
        "size [2 2 0.01]",
        "size [0 0 0]",
        "size [1 1 1] ranger_return 0",
        "size [1 1 1] laser_return 0",
    ],
)
def test_marks_on_the_floor_are_no_walls(folder, mark):
    world = read(folder, f"{WORLD}\nmodel ( pose [3 3 0 0] obstacle_return 0 {mark} )")
    assert len(world.walls) == len(read(folder, WORLD).walls)
    assert "1 model" in world.notes[-1]


def test_what_is_nested_stands_where_the_model_around_it_does(folder):
    leg = "model ( size [0.2 0.1 1] pose [0.5 0 0 90] )"
    table = f"define table model ( size [0 0 0] obstacle_return 0 {leg} )"
    world = read(folder, f"{table}\n{WORLD}\ntable ( pose [2 1 0 90] )")
    x, y = world.walls[-4:].reshape(-1, 2).T
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((1.9, 2.1, 1.45, 1.55))


def test_an_origin_moves_the_shape_within_its_model(folder):
    moved = "model ( size [0.4 0.2 1] origin [0.5 0 0 0] pose [1 1 0 90] )"
    x, y = read(folder, f"{WORLD}\n{moved}").walls[-4:].reshape(-1, 2).T
    assert (x.min(), x.max(), y.min(), y.max()) == pytest.approx((0.9, 1.1, 1.3, 1.7))


def test_a_number_with_two_points_matters_only_where_it_is_used(folder):
    light = "robot ( light ( pose [0.1 -0.1000.000 0.000] ) )"
    assert np.array_equal(read(folder, WORLD + light).walls, read(folder, WORLD).walls)


def test_properties_of_old_files_are_read(folder):
    old = "define bot position ( block[0].points 3 block[0].point[1] [ 0.1 0.2 ] )\nbot ( )"
    assert np.array_equal(read(folder, WORLD + old).walls, read(folder, WORLD).walls)


# Where the robot starts.


def two_rooms(folder, robots=""):
    """Rooms of 3.8 m and 5.8 m by 5.8 m, with a wall between them."""
    pixels = np.full((60, 100), 255, np.uint8)
    pixels[:, :1] = pixels[:, -1:] = pixels[:1] = pixels[-1:] = pixels[:, 40:42] = 0
    Image.fromarray(pixels).save(folder / "bitmaps" / "two.png")
    plan = 'floorplan ( bitmap "bitmaps/two.png" size [10 6 1] )\n'
    return read(folder, f"define bot position ( )\n{plan}{robots}").starts[0, :2]


def test_the_start_is_in_the_largest_room_or_where_the_first_robot_is(folder):
    assert -1 < two_rooms(folder)[0] < 5
    assert -5 < two_rooms(folder, "bot ( pose [-3 0 0 0] )\nbot ( pose [3 0 0 0] )")[0] < -1
    assert -1 < two_rooms(folder, "bot ( pose [-9 0 0 0] )")[0] < 5


def test_among_posts_the_start_is_within_their_hull(folder):
    places = ((0, 0), (30, 0), (0, 30))
    posts = (f"model ( pose [{x} {y} 0 0] size [0.4 0.4 1] )" for x, y in places)
    x, y = read(folder, "\n".join(posts)).starts[0, :2]
    assert x > 4
    assert y > 4
    assert x + y < 24


def test_a_building_with_an_open_door_is_started_in_not_its_closet(folder):
    pixels = np.full((60, 100), 255, np.uint8)
    pixels[:, :1] = pixels[:, -1:] = pixels[:1] = pixels[-1:] = 0
    pixels[10, :10] = pixels[:10, 10] = 0
    pixels[30:40, -1] = 255
    Image.fromarray(pixels).save(folder / "bitmaps" / "open.png")
    world = read(folder, 'floorplan ( bitmap "bitmaps/open.png" size [20 12 1] )')
    assert (np.abs(world.starts[0, :2]) < (8, 5)).all()
    assert world.notes == ("no walls enclose the start: a robot can leave the map",)


@pytest.mark.parametrize(
    "thing",
    [
        "model ( size [4 4 1] )",
        "model ( size [4 4 1] block ( point[0] [0 0] point[1] [2 0] point[2] [1 2] ) )",
        'model ( size [4 4 1] bitmap "bitmaps/disc.png" )',
    ],
)
def test_the_start_is_not_inside_a_thing(folder, thing):
    y, x = np.mgrid[-20:21, -20:21]
    disc = np.where(x**2 + y**2 <= 400, 0, 255).astype(np.uint8)
    Image.fromarray(disc).save(folder / "bitmaps" / "disc.png")
    posts = "model ( pose [6 0 0 0] size [0.3 0.3 1] )\nmodel ( pose [0 6 0 0] size [0.3 0.3 1] )"
    world = read(folder, f"{thing}\n{posts}")
    assert np.abs(world.starts[0, :2]).max() > 2
    assert world.reaches(world.starts[0, :2])
    assert world.notes == ("no walls enclose the start: a robot can leave the map",)


def test_definitions_that_build_on_each_other_come_to_an_end(folder):
    with pytest.raises(InputError, match="a model that is an obstacle"):
        read(folder, "define a b ( )\ndefine b a ( )\na ( )")


def test_the_robotics_lab_is_as_large_as_its_file_says(data):
    world = load_world(str(data / "grids" / "uoa_robotics_lab.world"))
    x_min, y_min, x_max, y_max = world.bounds
    assert (x_max - x_min, y_max - y_min) == pytest.approx((6.27, 15.7))
    assert world.closed
