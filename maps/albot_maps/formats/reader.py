"""World files of every format, told apart by name and content."""

from __future__ import annotations

from pathlib import Path

from albot_core.errors import InputError
from albot_maps.formats.world_yaml import world_from_document
from albot_maps.formats.yaml_document import read_yaml
from albot_maps.world import World

_YAML = {".yaml", ".yml"}
_PICTURES = {".pgm", ".png"}


def read_world(path: Path) -> World:
    """The world in a file: our own YAML or a foreign format, told by the file's ending.

    Foreign are a ROS map (its YAML or its picture), a plan's XML, a HouseExpo house (JSON)
    and a Stage world.

    Any of them may be compressed (`.gz`, `.xz`).

    Raises:
        InputError: The file cannot be read, its format is not known, or it is wrong.
    """
    kind = Path(path.stem).suffix if path.suffix in {".gz", ".xz"} else path.suffix
    if kind in _YAML:
        return _read_yaml_world(path)
    # The readers of foreign formats are imported when they are needed: they are slow to load.
    if kind == ".xml":
        from albot_maps.formats.plan_xml import read_plan_xml

        return read_plan_xml(path)
    if kind == ".json":
        from albot_maps.formats.house_json import read_house_json

        return read_house_json(path)
    if kind == ".world":
        from albot_maps.formats.stage_world import read_stage_world

        return read_stage_world(path)
    if kind in _PICTURES:
        return _read_yaml_world(_description_of(path))
    raise InputError(
        path, "a world file: .yaml, .xml, .json, .world, .pgm or .png", kind or "no suffix"
    )


def _read_yaml_world(path: Path) -> World:
    document = read_yaml(path)
    if isinstance(document.data, dict) and "image" in document.data:
        from albot_maps.formats.ros_grid import read_ros_grid

        return read_ros_grid(document, path)
    return world_from_document(document, source=str(path))


def _description_of(picture: Path) -> Path:
    """The YAML beside a ROS map's picture."""
    if not picture.exists():
        raise InputError(picture, "a file that exists", "none")
    stem = picture.name.split(".")[0]
    for suffix in sorted(_YAML):
        path = picture.with_name(picture.name.replace(".gz", "")).with_suffix(suffix)
        if path.is_file():
            return path
    raise InputError(picture, f"its map_server description {stem}.yaml beside it", "none")
