"""`Albot/PlaceRecognition-v0`: say at each stop which earlier stop was at this place, if any."""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.place_recognition.task import PlaceRecognitionTask


class PlaceRecognitionEnv(SingleEnv[PlaceRecognitionTask]):
    """A robot is led from room to room and judges which places it has seen before.

    Description:
        A guide leads the robot on a tour through the rooms of a building, in start-stop motion of
        at most 1 m and 45°. At a random point of a room the robot stops, turns round once and
        looks around: this is an *arrival*. Half of the stops are in rooms where it has stopped
        before. The agent does not drive: a step is an arrival, and the agent judges whether an
        earlier arrival was at the same place. Two arrivals are at the same place if they are in
        the same room, or if only open floor lies between them, without a wall or a doorway (an
        opening of at most 1.5 m). Rooms that the robot only passes through are no arrivals. The
        start is the first arrival and is not judged. Dynamic obstacles are left out.

    Action space:
        `Discrete(1 + most)`: 0 means "I never stopped here before", k means "this is where I
        stopped at my k-th arrival". Any earlier arrival at the same place is right. Arrivals are
        numbered in the order in which they were made. The robot knows this order, so the numbers
        reveal nothing of the truth. `most` is the number of arrivals on a tour minus one. Any
        other action raises an `InputError`.

    Observation space:
        With `observation="dict"` two parts, by default the same in one row: `arrivals`
        (most, features), the features of each earlier arrival that tell whether it was here
        (`albot_env.tasks.place_recognition.spaces.FEATURES`), and `mask` (most,), which of the
        rows exist. All float32 in [-1, 1]. They are a function of the readings alone.

    Rewards:
        The sum of the terms of `PlaceRecognitionWeights`; `info["reward_terms"]` holds each term.

    Starting state:
        At the second arrival of a tour. World and start are drawn, or chosen by `options`, as in
        `Albot/Explore-v0`; the start is the start of the tour. The tour is drawn from `journeys`
        tours per start. Each tour is made when it is first drawn, which takes a second or two,
        and the most recently used GiB of them is cached. A tour is a function of its world,
        start and number alone.

    Episode end:
        Terminated when the last arrival is judged; the observation then is empty. The episode is
        a success if at least the share `PlaceRecognitionConfig.recall` (85 %) of the revisited
        places was recognised and no place was recognised falsely.

    Info:
        The truth, for evaluation: `world`, `room`, `pose`, `start`, `belief`, `position_error`,
        `collided`, `path_length`, `time` as in `Albot/Explore-v0`; `arrivals` (their number so
        far), `right_answer` (the latest earlier arrival at this place, or 0), the numbers of
        answers that were `right_known`, `right_new`, `false_known` (a wrong arrival named) or
        `missed` (a known place called new), `revisits` (the number of judged places that were
        known), `precision`, `recall`, `is_success`, `reward_terms`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`), with two
            rooms or more each.
        journeys: Number of tours per start, from which each reset draws one; 0 for a new one each
            time.
        config: Parameters of tours, rewards and success.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`; or `journeys` is negative. `reset` raises one if the world
            does not have two rooms in which a robot can stop.
    """

    task = PlaceRecognitionTask

    def action_masks(self) -> Bool[np.ndarray, "answers"]:
        """Return which answers are valid now, for learners such as sb3-contrib's MaskablePPO.

        0 is always valid, k if there is a k-th arrival before this one: what `mask` observes.

        Raises:
            ResetNeeded: There was no reset before.
            ClosedEnvironmentError: It has been closed.
        """
        self._check_begun()
        masks: Bool[np.ndarray, "answers"] = self._robot.action_masks()[0]
        return masks


class PlaceRecognitionVectorEnv(VectorEnv[PlaceRecognitionTask]):
    """Robots that judge where they are, each as in its own `PlaceRecognitionEnv`; they share tours.

    See `PlaceRecognitionEnv` for the task and `VectorEnv` for the further arguments.
    """

    task = PlaceRecognitionTask

    def action_masks(self) -> Bool[np.ndarray, "environments answers"]:
        """Return which answers are valid now (see `PlaceRecognitionEnv.action_masks`)."""
        self._check_open()
        return self._robots.action_masks()
