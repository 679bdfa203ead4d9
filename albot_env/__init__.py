"""The simulator, its sensors, the gymnasium environments, recording and rendering.

Importing this package registers its environments with gymnasium. A new task is a folder in
`albot_env.tasks` with the same layout as the others, and a line in the table below.
"""

import gymnasium

_TASKS = (
    # Name, folder in `albot_env.tasks`, steps after which an episode is truncated.
    ("Explore", "explore", 6000),
    ("Homing", "homing", 3000),
    ("ExploreAndHome", "explore_and_home", None),
    ("PlaceRecognition", "place_recognition", None),
)

for _name, _folder, _steps in _TASKS:
    gymnasium.register(
        id=f"Albot/{_name}-v0",
        entry_point=f"albot_env.tasks.{_folder}.env:{_name}Env",
        vector_entry_point=f"albot_env.tasks.{_folder}.env:{_name}VectorEnv",
        max_episode_steps=_steps,
    )
