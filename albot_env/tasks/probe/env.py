"""`Albot/Probe-…-v0`: come home in a fixed scene with a known answer."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.probe.task import (
    DetourTask,
    HiddenGoalTask,
    ProbeTask,
    RectangleTask,
    SunburstTask,
    TriangleCompletionTask,
)


class ProbeEnv(SingleEnv[ProbeTask]):
    """A robot was led along a tour of a scene, and is to come home. Each scene is a class below.

    Description:
        The task is that of `Albot/HomingByMap-v0`, in one of the scenes of `scenes`. The robot is
        led along a tour by a guide, which knows its true pose, and builds its map on the way. Then
        something is changed, of which it is told nothing. A step is 0.1 s.

    Action space:
        As in `Albot/HomingByMap-v0`, by default without claims (`ProbeConfig`).

    Observation space:
        As in `Albot/HomingByMap-v0`; hints can be observed if `ProbeConfig.hints` is set.

    Rewards:
        The sum of the terms of `HomingWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        At rest where the tour ends, or where the robot was carried. The trial is drawn, or that of
        `ProbeConfig.trial`. With `journeys`, tour k leads through trial k modulo their number.

    Episode end:
        As in `Albot/Homing-v0`.

    Info:
        As in `Albot/Homing-v0`, and: `trial` (its name in the scene), and `choice`: the name of the
        point of choice that the robot reached first, or, in a scene in which the end counts, that
        it is at now; `none` at none.

    Args:
        world: The scene's world, as it is registered; no other is accepted.
        journeys: Number of tours, each with its noise; 0 for a new one each time.
        config: Parameters of actions, observations, rewards, success and trials.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `Albot/Homing-v0`; or the trial is unknown, or the world another.
    """


class ProbeVectorEnv(VectorEnv[ProbeTask]):
    """Robots in a scene, each as in its own `ProbeEnv`.

    See `ProbeEnv` for the task and `VectorEnv` for the further arguments.
    """


class TriangleCompletionEnv(ProbeEnv):
    """Path integration alone: two legs over an open floor, and home by the third.

    Description:
        The robot is led 2, 4 or 6 m ahead, turns by 60, 90 or 120°, and is led 2, 4 or 6 m farther.
        Its laser sees nothing. 27 trials, to the left and to the right in turn.
        See `ProbeEnv` for all else.
    """

    task = TriangleCompletionTask


class TriangleCompletionVectorEnv(ProbeVectorEnv):
    """Robots in the scene of `TriangleCompletionEnv`."""

    task = TriangleCompletionTask


class SunburstEnv(ProbeEnv):
    """A shortcut never driven: the known way is shut, and 16 new alleys are open.

    Description:
        The robot is led from the food, which is home, round several corners to a round table. The
        alley by which it came is then shut at its end, and 16 others are open. That 40° to the
        right of the old one leads straight to the food.
        See `ProbeEnv` for all else.
    """

    task = SunburstTask


class SunburstVectorEnv(ProbeVectorEnv):
    """Robots in the scene of `SunburstEnv`."""

    task = SunburstTask


class DetourEnv(ProbeEnv):
    """A detour: the doorway in a barrier is shut, and one of two ways round is shorter.

    Description:
        The robot is led from home through the doorway of a barrier, and looks round behind it. The
        doorway is then shut. The way round one end of the barrier is much shorter.
        See `ProbeEnv` for all else.
    """

    task = DetourTask


class DetourVectorEnv(ProbeVectorEnv):
    """Robots in the scene of `DetourEnv`."""

    task = DetourTask


class RectangleEnv(ProbeEnv):
    """Geometry against a feature: the robot is turned round in a rectangular room.

    Description:
        Home is in a corner, in which a column stands. The robot is led past all corners, carried to
        the middle and turned to a heading that is drawn. The column is where it was, is gone, or
        is in the next corner along the long wall.
        See `ProbeEnv` for all else.
    """

    task = RectangleTask


class RectangleVectorEnv(ProbeVectorEnv):
    """Robots in the scene of `RectangleEnv`."""

    task = RectangleTask


class HiddenGoalEnv(ProbeEnv):
    """A hidden goal: home is an unmarked point of an open floor, with all cues far away.

    Description:
        The robot is led over the floor, past home twice, and carried to its northern, eastern,
        southern or western edge, facing outwards.
        See `ProbeEnv` for all else.
    """

    task = HiddenGoalTask


class HiddenGoalVectorEnv(ProbeVectorEnv):
    """Robots in the scene of `HiddenGoalEnv`."""

    task = HiddenGoalTask
