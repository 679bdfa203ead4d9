"""The simulator, its sensors, the gymnasium environments, recording and rendering.

Importing this package registers its environments with gymnasium.
"""

import gymnasium

gymnasium.register(
    id="Albot/Explore-v0",
    entry_point="albot_env.tasks.explore.env:ExploreEnv",
    vector_entry_point="albot_env.vector.explore:ExploreVectorEnv",
    max_episode_steps=6000,
)
gymnasium.register(
    id="Albot/Homing-v0",
    entry_point="albot_env.tasks.homing.env:HomingEnv",
    vector_entry_point="albot_env.vector.homing:HomingVectorEnv",
    max_episode_steps=3000,
)
gymnasium.register(
    id="Albot/ExploreAndHome-v0",
    entry_point="albot_env.tasks.explore_and_home.env:ExploreAndHomeEnv",
    vector_entry_point="albot_env.vector.explore_and_home:ExploreAndHomeVectorEnv",
)
gymnasium.register(
    id="Albot/PlaceRecognition-v0",
    entry_point="albot_env.tasks.place_recognition.env:PlaceRecognitionEnv",
    vector_entry_point="albot_env.vector.place_recognition:PlaceRecognitionVectorEnv",
)
