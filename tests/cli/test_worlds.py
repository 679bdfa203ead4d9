"""`albot worlds` from end to end, and what it answers to bad worlds."""

from __future__ import annotations

import json
import os
import resource
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from albot_cli import worlds
from albot_cli.main import main
from albot_core.drawing.palette import HOME, rgb
from albot_maps import catalogue_names, load_world
from albot_maps.generators.spec import KINDS, parameters_of
from tests.maps.formats import test_plan_xml

GOOD = """\
albot-world: 1
name: hut
walls:
  - [[0, 0], [4, 0], [4, 3], [0, 3], [0, 0]]
starts:
  - {at: [1, 1], heading: 0}
"""
PLAN = """\
<building><scale><represented_distance><value>10</value><um>pixel</um></represented_distance>
<real_distance><value>90</value><um>cm</um></real_distance></scale><floor><spaces>
<space id="a"><labels><label>HALL</label></labels><bounding_polygon><point x="0" y="0"/>
<point x="50" y="0"/><point x="50" y="50"/><point x="0" y="50"/></bounding_polygon></space>
</spaces></floor></building>
"""
MAP = "image: {}\nresolution: 0.05\norigin: [0, 0, 0]\nnegate: 0\n"
MAP += "occupied_thresh: 0.65\nfree_thresh: 0.196\n"


@pytest.fixture
def albot(monkeypatch, capsys, tmp_path):
    """Run `albot worlds …` in an empty folder; exit status, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["albot", "worlds", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        printed = capsys.readouterr()
        return int(ended.value.code or 0), printed.out, printed.err

    return run


def test_list_shows_the_whole_catalogue(albot):
    status, out, err = albot("list")
    assert (status, err) == (0, "")
    assert [line.split()[0] for line in out.splitlines()] == list(catalogue_names())
    assert {"office-double", "office-ring", "square-loop"} <= set(catalogue_names())


def test_list_as_json(albot):
    _, out, _ = albot("list", "--json")
    worlds = {world["name"]: world for world in json.loads(out)["worlds"]}
    assert set(worlds) == set(catalogue_names())
    assert worlds["office-double"]["exits"]["E8"] == ["P8", "P2"]
    assert worlds["square-loop"]["tours_m"] == {"loop": 18.0}
    assert all(world["closed"] for world in worlds.values())


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_show_draws_a_floor_plan(albot, flags):
    status, out, err = albot("show", "office-ring", "--png", "ring.png", *flags)
    assert (status, err) == (0, "")
    with Image.open("ring.png") as picture:
        assert min(picture.size) > 1000
        assert len(picture.convert("RGB").getcolors(picture.width * picture.height)) > 20
    assert "P5" in out
    if flags:
        assert json.loads(out)["png"] == "ring.png"
    assert [path.name for path in Path().iterdir()] == ["ring.png"]
    message = "albot: ring.png: expected no existing file, or --force to overwrite it, found one\n"
    assert albot("show", "office-ring", "--png", "ring.png") == (2, "", message)
    assert albot("show", "square-loop", "--png", "ring.png", "--force")[0] == 0


def test_check_says_what_a_world_holds(albot):
    Path("hut.yaml").write_text(GOOD)
    assert albot("check", "hut.yaml") == (
        0,
        "hut.yaml: a valid world, 4.0 x 3.0 m, 0 rooms, 0 exits, 4 walls\n",
        "",
    )
    _, out, _ = albot("check", "hut.yaml", "--json")
    assert json.loads(out)["valid"] is True


def test_convert_writes_a_world_that_reads_the_same(albot):
    Path("plan.xml").write_text(PLAN)
    status, out, err = albot("convert", "plan.xml", "-o", "plan.yaml", "--json")
    assert (status, err) == (0, "")
    assert json.loads(out)["out"] == "plan.yaml"
    original, converted = load_world("plan.xml"), load_world("plan.yaml")
    assert np.array_equal(original.walls, converted.walls)
    assert np.array_equal(original.starts, converted.starts)
    assert converted.rooms[0].name == "HALL"
    assert albot("convert", "plan.xml", "-o", "plan.yaml")[0] == 2
    assert albot("convert", "plan.xml", "-o", "plan.yaml", "--force")[0] == 0


def bad_files(folder: Path) -> None:
    """One of every kind of bad world."""
    texts = {
        "point.yaml": GOOD.replace("[4, 3], [0, 3]", "[4, 3], [4, 3]"),
        "nan.yaml": GOOD.replace("[4, 3]", "[.nan, 3]"),
        "inside.yaml": GOOD + "boxes:\n  - [0.5, 0.5, 2, 2]\n",
        "close.yaml": GOOD.replace("at: [1, 1]", "at: [0.1, 1]"),
        "typo.yaml": GOOD.replace("walls:", "wall:"),
        "list.yaml": "- 1\n- 2\n",
        "torn.xml": PLAN[:200],
        "nowhere.yaml": MAP.format("gone.pgm"),
        "cut.yaml": MAP.format("cut.pgm"),
        "cut.pgm": "P5\n40 40\n255\nabc",
        "lone.pgm": "P5\n2 2\n255\nabcd",
        "odd.txt": "hello",
        "torn.yaml.gz": "no gzip",
    }
    for name, text in texts.items():
        (folder / name).write_text(text)
    (folder / "latin.yaml").write_bytes("name: Büro".encode("latin-1"))
    (folder / "folder.yaml").mkdir()


@pytest.mark.parametrize("verb", ["check", "show", "convert"])
@pytest.mark.parametrize(
    ("world", "words"),
    [
        ("point.yaml", "point.yaml, line 4, walls[0][2]: expected a wall longer than 0"),
        ("nan.yaml", "nan.yaml, line 4, walls[0][2]: expected finite numbers"),
        ("inside.yaml", "inside.yaml, line 6, starts[0]: expected a start in free space"),
        ("close.yaml", "close.yaml, line 6, starts[0]: expected free space of radius 0.25 m"),
        ("typo.yaml", "typo.yaml, line 3, wall: expected one of the keys"),
        ("list.yaml", "list.yaml, line 1: expected a YAML mapping"),
        ("torn.xml", "torn.xml, line 3: expected well-formed XML, found unclosed token\n"),
        ("nowhere.yaml", "nowhere.yaml, line 1, image: expected a picture that exists, found gone"),
        ("cut.yaml", "cut.pgm: expected an intact PGM or PNG image"),
        ("lone.pgm", "lone.pgm: expected its map_server description lone.yaml in the same folder"),
        ("odd.txt", "odd.txt: expected a world file"),
        ("torn.yaml.gz", "torn.yaml.gz: expected intact gz data"),
        ("latin.yaml", "latin.yaml, line 1: expected UTF-8 text, found the byte 0xfc"),
        ("folder.yaml", "folder.yaml: expected a file, found a folder"),
        ("gone.yaml", "gone.yaml: file not found"),
        ("ofice-ring", "found ofice-ring (did you mean office-ring?)"),
        ("random:ofice:42", "one of the kinds apartment, hall, maze, office, ring, warehouse, f"),
        ("random:office", "random:office: expected the form random:KIND:SEED"),
        ("random:office:4?room=9", "random:office: expected one of rooms, loops, width, depth, co"),
        ("random:office:4?rooms=0", "random:office, rooms: expected a whole number from 2 to 200"),
        ("", "expected a file, random:KIND:SEED or one of corridor-loop"),
    ],
)
@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_a_bad_world_gets_one_line_and_leaves_nothing(albot, tmp_path, verb, world, words, flags):
    bad_files(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    out = {"check": [], "show": ["--png", "out.png"], "convert": ["-o", "out.yaml"]}[verb]
    status, printed, complaint = albot(verb, world, *out, *flags)
    assert (status, printed) == (2, "")
    assert complaint.startswith("albot: ")
    assert complaint.count("\n") == 1
    assert words in complaint
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("show", "square-loop", "--png", "out.jpg"), "--png: expected a name that ends in .png"),
        (("convert", "square-loop", "-o", "out.json"), "--out: expected a name that ends in .yaml"),
        (("convert", "square-loop", "-o", "hut/out.yaml"), "expected a file to write"),
        (("show", "square-loop", "--png", "hut/out.png"), "expected a file to write"),
        (("convert", "square-loop", "-o", "folder.yaml"), "expected a file to write, found a fol"),
    ],
)
def test_a_place_that_cannot_be_written_gets_one_line(albot, arguments, words):
    Path("hut").write_text("a file, not a folder")
    Path("folder.yaml").mkdir()
    status, printed, complaint = albot(*arguments)
    assert (status, printed) == (2, "")
    assert words in complaint
    assert complaint.count("\n") == 1
    assert {path.name for path in Path().iterdir()} == {"hut", "folder.yaml"}


def test_make_writes_worlds_that_read_the_same(albot):
    arguments = ("make", "office", "--count", "3", "--seed", "5", "--param", "rooms=8")
    status, out, err = albot(*arguments, "--param", "clutter=0", "--out", "made", "--json")
    assert (status, err) == (0, "")
    made = json.loads(out)["worlds"]
    assert [each["name"] for each in made] == ["office-5", "office-6", "office-7"]
    for each in made:
        written, again = load_world(each["file"]), load_world(each["source"])
        assert each["source"].endswith("?rooms=8&clutter=0.0")
        assert np.array_equal(written.walls, again.walls)
        assert [room.name for room in written.rooms] == each["rooms"]
        assert sum(not name.startswith(("corridor", "link")) for name in each["rooms"]) == 8
    status, _, err = albot(*arguments, "--out", "made")
    assert status == 2
    assert err.startswith("albot: made/office-5.yaml: expected no existing file, or --force")
    assert albot(*arguments, "--out", "made", "--force")[0] == 0
    assert albot(*arguments, "--out", "new/made")[0] == 0


def test_make_says_what_it_has_written(albot):
    words = ("make", "ring", "--count", "2", "--out", "made", "--png", "sheet.png")
    status, out, _ = albot(*words)
    assert status == 0
    lines = out.splitlines()
    assert [line.split()[-1] for line in lines] == [
        "made/ring-0.yaml",
        "made/ring-1.yaml",
        "sheet.png",
    ]
    assert all(Path(line.split()[-1]).is_file() for line in lines)
    assert "wall" in lines[0]


def test_make_writes_more_worlds_than_a_process_can_have_files_open(albot):
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    free = os.open(os.devnull, os.O_RDONLY)
    os.close(free)
    resource.setrlimit(resource.RLIMIT_NOFILE, (free + 20, hard))
    try:
        params = (word for name in ("columns=2", "rows=2", "loops=0") for word in ("--param", name))
        status, _, err = albot("make", "maze", "--count", "60", *params, "--out", "made")
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert (status, err) == (0, "")
    assert len(list(Path("made").glob("maze-*.yaml"))) == 60


def test_make_looks_at_the_folder_before_it_works(albot, monkeypatch):
    monkeypatch.setattr(worlds, "load_world", lambda spec: pytest.fail(f"made {spec}"))
    Path("hut").write_text("x")
    status, _, err = albot("make", "office", "--out", "hut")
    assert (status, err) == (2, "albot: hut: expected a folder to write to, found a file at hut\n")


@pytest.mark.parametrize("existed", [False, True])
def test_make_on_a_full_disk_leaves_nothing_new(albot, full_disk, existed):
    if existed:
        Path("made").mkdir()
    status, out, err = albot("make", "office", "--out", "made")
    assert (status, out) == (2, "")
    assert err == "albot: cannot write made/office-0.yaml: No space left on device\n"
    assert [str(path) for path in Path().rglob("*")] == ["made"] * existed


def test_make_draws_a_contact_sheet(albot):
    status, out, err = albot("make", "maze", "--count", "5", "--png", "sheet.png")
    assert (status, err) == (0, "")
    *_, last, sheet = out.splitlines()
    assert last.startswith("random:maze:4  ")
    assert sheet == "sheet.png"
    with Image.open("sheet.png") as picture:
        pixels = np.asarray(picture.convert("RGB")).astype(int)
    # Five plans in three columns and two rows; the sixth place stays white.
    height, width = pixels.shape[0] // 2, pixels.shape[1] // 3
    drawn = [
        (
            pixels[row * height : (row + 1) * height, column * width : (column + 1) * width] < 90
        ).any()
        for row in range(2)
        for column in range(3)
    ]
    assert drawn == [True] * 5 + [False]
    assert [path.name for path in Path().iterdir()] == ["sheet.png"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("office",), "expected --out DIR, --png FILE or --figure FILE, found none"),
        (("ofice", "--out", "o"), "found ofice (did you mean office?)"),
        (("office", "--out", "o", "--param", "room=3"), "found room (did you mean rooms?)"),
        (("office", "--out", "o", "--param", "rooms"), "found 'rooms'"),
        (("office", "--out", "o", "--count", "1000001"), "1000001 is not in the range"),
        (("office", "--png", "o.jpg"), "--png: expected a name that ends in .png"),
        (
            ("maze", "--png", "o.png", "--count", "101"),
            "--png: expected at most 100 worlds on one",
        ),
        (
            ("office", "--out", "o", "--param", "width=9", "--param", "loops=2"),
            "width: expected at",
        ),
    ],
)
@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_make_says_in_one_line_what_cannot_be_made(albot, arguments, words, flags):
    status, printed, complaint = albot("make", *arguments, *flags)
    assert (status, printed) == (2, "")
    assert complaint.count("\n") == 1
    assert words in complaint
    assert not list(Path().iterdir())


def test_make_lists_the_parameters_of_every_kind(albot):
    status, out, err = albot("make", "--help")
    assert (status, err) == (0, "")
    words = out.split()
    for kind in KINDS:
        assert f"Parameters of {kind}:" in out
        assert set(parameters_of(kind).ranges()) <= set(words)
    text = " ".join(words)
    assert "a whole number from 1 to 10 [default: 1]" in text
    assert "a whole number from 2 to 200 [default: 20, or the nearest that is possible]" in text


@pytest.mark.parametrize("words", [("check",), ("show",), ("convert", "--out", "a.yaml")])
def test_a_log_is_no_world(albot, corridor, words):
    name, *options = words
    status, out, err = albot(name, str(corridor[0]), *options)
    assert (status, out) == (2, "")
    assert "expected a world file" in err
    assert "found a robot's log, CARMEN" in err


@pytest.mark.parametrize("words", [("check",), ("show",), ("convert", "-o", "out.yaml")])
def test_a_strict_reading_refuses_what_would_be_left_out(albot, words):
    left = "skipped: NOOK, whose outline encloses no area"
    rooms = test_plan_xml.space("a", "A", test_plan_xml.LEFT)
    Path("a.xml").write_text(test_plan_xml.plan(rooms, test_plan_xml.space("b", "NOOK", [])))
    assert albot(*words, "a.xml")[0] == 0
    Path("out.yaml").unlink(missing_ok=True)
    status, out, err = albot(*words, "a.xml", "--strict")
    assert (status, out) == (2, "")
    assert err == f"albot: a.xml: expected a world without notes, with --strict, found {left}\n"
    Path("a.xml").write_text(test_plan_xml.plan(rooms))
    assert albot(*words, "a.xml", "--strict")[0] == 0


@pytest.mark.parametrize("name", ["map.pgm", "map.png"])
def test_a_picture_that_is_none_is_said_to_be_none(albot, name):
    Path(name).write_text("hello, world\n")
    Path("map.yaml").write_text(MAP.format(name))
    status, out, err = albot("check", name)
    assert (status, out) == (2, "")
    assert err == (
        f"albot: {name}: expected an intact PGM or PNG image (BMP, GIF and JPEG are read, too; "
        "convert any other), found another format\n"
    )


def test_a_picture_with_8_bits_in_16_says_what_to_convert(albot):
    Image.fromarray(np.zeros((4, 4), np.uint16)).save("map.png")
    Path("map.yaml").write_text(MAP.format("map.png"))
    _, _, err = albot("check", "map.yaml")
    assert err == (
        "albot: map.png: expected brightness from 0 to 65535 in a picture with 16 bits a pixel, "
        "found 0 at most; convert it to 8 bits\n"
    )


def draw_track(folder: Path) -> None:
    """A lane 3 m wide round an infield, in cells of 0.1 m; all else is white, outside too."""
    image = Image.new("L", (300, 300), 255)
    for radius in (50, 80):
        box = (150 - radius, 150 - radius, 150 + radius, 150 + radius)
        ImageDraw.Draw(image).ellipse(box, outline=0, width=3)
    image.save(folder / "track.png")
    (folder / "track.yaml").write_text(
        MAP.format("/home/of/another/track.png").replace("0.05", "0.1")
    )


def test_the_start_on_a_race_track_is_in_its_picture_and_its_conversion(albot, tmp_path):
    draw_track(tmp_path)
    status, out, _ = albot("check", "track.yaml", "--json")
    facts = json.loads(out)
    (x, y, heading), notes = facts["starts"][0], facts["notes"]
    assert (status, facts["closed"], heading) == (0, True, 0)
    assert 5.3 < np.hypot(x - 15, y - 15) < 7.7
    assert notes == ["/home/of/another/track.png is missing; used track.png"]
    albot("convert", "track.yaml", "-o", "own.yaml")
    _, out, _ = albot("show", "own.yaml", "--png", "own.png", "--json")
    assert json.loads(out)["starts"] == facts["starts"]
    pixels = np.asarray(Image.open("own.png").convert("RGB")).astype(int)
    assert np.count_nonzero(np.abs(pixels - rgb(HOME)).max(axis=-1) < 20) > 50
    status, _, err = albot("check", "track.yaml", "--strict")
    assert status == 2
    assert "track.png is missing" in err


@pytest.mark.parametrize("at", ["[6, 1.5]", "[1, -9]"])
def test_a_start_far_from_the_walls_is_refused(albot, tmp_path, at):
    (tmp_path / "hut.yaml").write_text(GOOD.replace("[1, 1]", at))
    status, out, err = albot("check", "hut.yaml")
    assert (status, out) == (2, "")
    assert "hut.yaml, line 6, starts[0]: expected at most 1 m outside the rectangle" in err


def test_a_world_is_checked_for_a_robot(albot, tmp_path):
    (tmp_path / "hut.yaml").write_text(GOOD.replace("[1, 1]", "[0.3, 1]"))
    assert albot("check", "hut.yaml")[0] == 0
    status, _, err = albot("check", "hut.yaml", "--robot", "peoplebot")
    assert status == 2
    assert "hut.yaml, line 6, starts[0]: expected free space of radius 0.34 m, found a" in err
    status, _, err = albot("check", "hut.yaml", "--robot", "turtle")
    assert status == 2
    assert "--robot: expected one of pioneer-3dx, kobuki, peoplebot" in err
