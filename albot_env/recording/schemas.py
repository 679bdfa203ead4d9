"""JSON Schemas of the messages in an episode file: Foxglove's and the project's own.

Foxglove identifies a message by its schema's name and reads the fields that its documentation
lists: https://docs.foxglove.dev/docs/sdk/schemas/introduction
"""

from __future__ import annotations

from typing import Any

Schema = dict[str, Any]

NUMBER: Schema = {"type": "number"}
STRING: Schema = {"type": "string"}
BOOLEAN: Schema = {"type": "boolean"}
NULL: Schema = {"type": "null"}
COUNT: Schema = {"type": "integer", "minimum": 0}
NANOSECONDS: Schema = {"type": "integer", "minimum": 0, "maximum": 999_999_999}


def _object(title: str, **properties: Schema) -> Schema:
    return {"title": title, "type": "object", "properties": properties}


def _strict(title: str, **properties: Schema) -> Schema:
    return _object(title, **properties) | {"required": list(properties)}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def _numbers(count: int) -> Schema:
    return _list(NUMBER) | {"minItems": count, "maxItems": count}


def _either(**values: int) -> Schema:
    return {"oneOf": [{"title": name, "const": value} for name, value in values.items()]}


TIME = _object("time", sec=COUNT, nsec=NANOSECONDS)
DURATION = _object("duration", sec={"type": "integer"}, nsec=NANOSECONDS)
VECTOR = _object("foxglove.Vector3", x=NUMBER, y=NUMBER, z=NUMBER)
POINT = _object("foxglove.Point3", x=NUMBER, y=NUMBER, z=NUMBER)
QUATERNION = _object("foxglove.Quaternion", x=NUMBER, y=NUMBER, z=NUMBER, w=NUMBER)
POSE = _object("foxglove.Pose", position=VECTOR, orientation=QUATERNION)
COLOUR = _object("foxglove.Color", r=NUMBER, g=NUMBER, b=NUMBER, a=NUMBER)

_MESH = {"points": _list(POINT), "color": COLOUR, "colors": _list(COLOUR), "indices": _list(COUNT)}
_PRIMITIVES: dict[str, Schema] = {
    "arrows": _object(
        "foxglove.ArrowPrimitive",
        pose=POSE,
        shaft_length=NUMBER,
        shaft_diameter=NUMBER,
        head_length=NUMBER,
        head_diameter=NUMBER,
        color=COLOUR,
    ),
    "cubes": _object("foxglove.CubePrimitive", pose=POSE, size=VECTOR, color=COLOUR),
    "spheres": _object("foxglove.SpherePrimitive", pose=POSE, size=VECTOR, color=COLOUR),
    "cylinders": _object(
        "foxglove.CylinderPrimitive",
        pose=POSE,
        size=VECTOR,
        bottom_scale=NUMBER,
        top_scale=NUMBER,
        color=COLOUR,
    ),
    "lines": _object(
        "foxglove.LinePrimitive",
        type=_either(LINE_STRIP=0, LINE_LOOP=1, LINE_LIST=2),
        pose=POSE,
        thickness=NUMBER,
        scale_invariant=BOOLEAN,
        **_MESH,
    ),
    "triangles": _object("foxglove.TriangleListPrimitive", pose=POSE, **_MESH),
    "texts": _object(
        "foxglove.TextPrimitive",
        pose=POSE,
        billboard=BOOLEAN,
        font_size=NUMBER,
        scale_invariant=BOOLEAN,
        color=COLOUR,
        text=STRING,
    ),
    "models": _object(
        "foxglove.ModelPrimitive",
        pose=POSE,
        scale=VECTOR,
        color=COLOUR,
        override_color=BOOLEAN,
        url=STRING,
        media_type=STRING,
        data=STRING | {"contentEncoding": "base64"},
    ),
}
PRIMITIVES = tuple(_PRIMITIVES)
"""Names of the lists of shapes in a scene entity."""

FRAME_TRANSFORMS = _object(
    "foxglove.FrameTransforms",
    transforms=_list(
        _object(
            "foxglove.FrameTransform",
            timestamp=TIME,
            parent_frame_id=STRING,
            child_frame_id=STRING,
            translation=VECTOR,
            rotation=QUATERNION,
        )
    ),
)
LASER_SCAN = _object(
    "foxglove.LaserScan",
    timestamp=TIME,
    frame_id=STRING,
    pose=POSE,
    start_angle=NUMBER,
    end_angle=NUMBER,
    ranges=_list(NUMBER),
    intensities=_list(NUMBER),
)
POSE_IN_FRAME = _object("foxglove.PoseInFrame", timestamp=TIME, frame_id=STRING, pose=POSE)
SCENE_UPDATE = _object(
    "foxglove.SceneUpdate",
    deletions=_list(
        _object(
            "foxglove.SceneEntityDeletion",
            timestamp=TIME,
            type=_either(MATCHING_ID=0, ALL=1),
            id=STRING,
        )
    ),
    entities=_list(
        _object(
            "foxglove.SceneEntity",
            timestamp=TIME,
            frame_id=STRING,
            id=STRING,
            lifetime=DURATION,
            frame_locked=BOOLEAN,
            metadata=_list(_object("foxglove.KeyValuePair", key=STRING, value=STRING)),
            **{name: _list(shape) for name, shape in _PRIMITIVES.items()},
        )
    ),
)

SONAR_GEOMETRY = _strict(
    "albot.SonarGeometry",
    bearings=_list(NUMBER),
    places=_list(_numbers(2)),
    cone=NUMBER,
    min_range=NUMBER,
    max_range=NUMBER,
)
LASER_GEOMETRY = _strict(
    "albot.LaserGeometry",
    beams=COUNT,
    first_bearing=NUMBER,
    spacing=NUMBER,
    max_range=NUMBER,
    mount=_numbers(3),
)
EPISODE_HEADER = _strict(
    "albot.EpisodeHeader",
    format={"const": 7, "description": "Version of the albot messages."},
    environment=STRING,
    world=STRING,
    walls=_list(_numbers(4)),
    start=_numbers(3),
    mapper=STRING,
    odometer=STRING,
    robot_radius={"type": "number", "exclusiveMinimum": 0, "description": "In metres."},
    agent=STRING,
    seed={"type": ["integer", "null"]},
    spec={
        "type": ["object", "null"],
        "description": "The environment's spec, as gymnasium's EnvSpec.to_json writes it.",
    },
    laser={"oneOf": [LASER_GEOMETRY, NULL], "description": "Null on a robot without a laser."},
    sonar={"oneOf": [SONAR_GEOMETRY, NULL], "description": "Null on a robot without sonars."},
    way_out=_list(_numbers(2))
    | {"description": "True path that led to where the episode begins, world frame; or empty."},
)
STEP = _strict(
    "albot.Step",
    stamp=NUMBER | {"description": "Simulated time (s), exact; the message's own is in ns."},
    action={"oneOf": [_list(NUMBER), NULL], "description": "As the agent gave it."},
    reward=NUMBER,
    terms={"type": "object", "additionalProperties": NUMBER},
    motion=_numbers(3) | {"description": "Odometry in the robot's previous frame."},
    echoes={
        "oneOf": [_list({"type": ["number", "null"]}), NULL],
        "description": "Ranges of the sonars (m), null where nothing came back; or no sonars.",
    },
    scene={"type": ["integer", "null"], "description": "The visual scene, null where none."},
    compass={
        "type": ["number", "null"],
        "description": "Heading by the compass (rad), null without one.",
    },
    pose=_numbers(3) | {"description": "Where the robot truly is, world frame."},
    collided=BOOLEAN,
    room=STRING,
    path_length=NUMBER,
    belief=_numbers(3) | {"description": "Where the robot believes to be, map frame."},
    home=_numbers(3) | {"description": "Where home is believed to be, robot frame."},
    updates=COUNT | {"description": "Readings that the mapper has added to its map."},
    matched_reading={
        "type": ["integer", "null"],
        "description": "The earlier reading believed to be of this place, counted from 0.",
    },
    facts={
        "type": "object",
        "additionalProperties": {"type": ["boolean", "number", "string", "null"]},
        "description": "What the task's info says, without what other fields hold.",
    },
)
_PLACE = _strict(
    "albot.Place",
    id=COUNT,
    label=STRING,
    pose=_numbers(3),
    middle=_numbers(2),
    segments=_list(_numbers(4)) | {"description": "In the place's own frame."},
)
_EDGE = _strict(
    "albot.Edge",
    source=COUNT,
    target=COUNT,
    motion=_numbers(3) | {"description": "The target's frame in the source's."},
    doorway={"oneOf": [_numbers(4), NULL], "description": "In the source's frame."},
    reverse={"type": ["integer", "null"], "description": "Number of the edge back."},
)
_ID = {"type": ["integer", "null"]}
LAYER_SCHEMAS: dict[str, Schema] = {
    "segments": _strict("albot.Segments", segments=_list(_numbers(4))),
    "occupancy_grid": _strict(
        "albot.OccupancyGrid",
        origin=_numbers(3),
        resolution=NUMBER,
        rows=COUNT,
        columns=COUNT,
        occupancy=STRING
        | {
            "contentEncoding": "base64",
            "description": "A byte a cell, row by row: occupied with k / 254; 255 unknown.",
        },
    ),
    "place_graph": _strict(
        "albot.PlaceGraph", nodes=_list(_PLACE), edges=_list(_EDGE), current=_ID, home=_ID
    ),
    "particles": _strict("albot.Particles", poses=_list(_numbers(3)), weights=_list(NUMBER)),
    "trajectory": _strict("albot.Trajectory", poses=_list(_numbers(3))),
}
"""The schema of each kind of layer."""
MAP = _object("albot.Map", **LAYER_SCHEMAS) | {
    "description": "The layers that the map has, by their kind, map frame."
}
POSES_IN_FRAME = _object(
    "foxglove.PosesInFrame", timestamp=TIME, frame_id=STRING, poses=_list(POSE)
)
GRID = _object(
    "foxglove.Grid",
    timestamp=TIME,
    frame_id=STRING,
    pose=POSE,
    column_count=COUNT,
    cell_size=_object("foxglove.Vector2", x=NUMBER, y=NUMBER),
    row_stride=COUNT,
    cell_stride=COUNT,
    fields=_list(
        _object(
            "foxglove.PackedElementField",
            name=STRING,
            offset=COUNT,
            type=_either(UNKNOWN=0, UINT8=1),
        )
    ),
    data=STRING | {"contentEncoding": "base64"},
)

THINGS = _strict(
    "albot.Things",
    segments=_list(_numbers(4)) | {"description": "Outlines of what moves, world frame."},
)

ACTIVITY = _strict(
    "albot.Activity",
    cell=NUMBER | {"description": "Side of a cell (m)."},
    rows=COUNT,
    columns=COUNT,
    active=_list(COUNT) | {"description": "Numbers of the active places, row by row."},
    values=_list(NUMBER) | {"description": "How active each of them is."},
    packet=_numbers(3) | {"description": "Centre of the largest packet, network frame."},
) | {"description": "Activity of an attractor network over its plane (x', y')."}

TOPICS: dict[str, Schema] = {
    "/albot/header": EPISODE_HEADER,
    "/tf": FRAME_TRANSFORMS,
    "/scan": LASER_SCAN,
    "/sonars": SCENE_UPDATE,
    "/home": POSE_IN_FRAME,
    "/walls": SCENE_UPDATE,
    "/things": SCENE_UPDATE,
    "/map/segments": SCENE_UPDATE,
    "/map/occupancy_grid": GRID,
    "/map/place_graph": SCENE_UPDATE,
    "/map/particles": POSES_IN_FRAME,
    "/map/trajectory": POSES_IN_FRAME,
    "/albot/things": THINGS,
    "/activity": GRID,
    "/albot/activity": ACTIVITY,
    "/albot/map": MAP,
    "/albot/step": STEP,
}
"""The topics of an episode file and the schemas of their messages."""
