"""The simulator, its sensors, the gymnasium environments, recording and rendering.

Importing this package registers its environments with gymnasium. A new task is a folder in
`albot_env.tasks` with the same layout as the others, and a line in the table below.
"""

import gymnasium

__version__ = "0.1.0"
"""The project's version, which its packages are built with."""

_TASKS = (
    # Id, class, folder in `albot_env.tasks`, steps after which an episode is truncated.
    ("Explore-v0", "Explore", "explore", 6000),
    ("Homing-v0", "Homing", "homing", 3000),
    ("HomingByMap-v0", "HomingByMap", "homing_by_map", 3000),
    ("ExploreAndHome-v1", "ExploreAndHome", "explore_and_home", None),
    ("PlaceRecognition-v0", "PlaceRecognition", "place_recognition", None),
    ("Probe-TriangleCompletion-v0", "TriangleCompletion", "probe", 3000),
    ("Probe-Sunburst-v0", "Sunburst", "probe", 3000),
    ("Probe-Detour-v0", "Detour", "probe", 3000),
    ("Probe-Rectangle-v0", "Rectangle", "probe", 3000),
    ("Probe-HiddenGoal-v0", "HiddenGoal", "probe", 3000),
)
_WORLDS = {
    "TriangleCompletion": "probe-triangle",
    "Sunburst": "probe-sunburst",
    "Detour": "probe-detour",
    "Rectangle": "probe-rectangle",
    "HiddenGoal": "probe-pool",
}
"""The worlds of tasks that have one of their own."""

for _id, _name, _folder, _steps in _TASKS:
    for _twin in ("", "Revealed") if _name != "PlaceRecognition" else ("",):
        gymnasium.register(
            id=f"Albot/{_id.replace('-v', f'{_twin}-v')}",
            entry_point=f"albot_env.tasks.{_folder}.env:{_name}Env",
            vector_entry_point=f"albot_env.tasks.{_folder}.env:{_name}VectorEnv",
            max_episode_steps=_steps,
            kwargs=({"reveal": True} if _twin else {})
            | ({"world": _WORLDS[_name]} if _name in _WORLDS else {}),
        )
