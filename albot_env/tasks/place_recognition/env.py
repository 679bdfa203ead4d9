"""`Albot/PlaceRecognition-v0`: say at each stop which earlier stop was here, if any."""

from __future__ import annotations

from albot_env.tasks.core.single import SingleEnv
from albot_env.tasks.core.vector import VectorEnv
from albot_env.tasks.place_recognition.task import PlaceRecognitionTask


class PlaceRecognitionEnv(SingleEnv[PlaceRecognitionTask]):
    """A robot is led from room to room, and judges which it has seen before.

    Description:
        A guide leads the robot along a tour through the rooms of a building, in start-stop motion
        of 1 m and 45° at most. It stops at a point of a room that is drawn anew each time, turns
        round once and looks about: this is an *arrival*. Half of the stops are in rooms where it
        has stopped before. The agent does not drive: a step is an arrival, and it judges
        whether an earlier one was at the same place: in the same room, or where nothing but
        open floor lies between, neither a wall nor a doorway (an opening of no more than 1.5 m).
        Rooms that the robot only passes through are no arrivals. The place where it sets out is
        the first arrival; of that it is asked nothing. What moves in a world is left out.

    Action space:
        `Discrete(1 + most)`: 0 says "I never stopped here before", k "this is where I stopped at
        my k-th arrival". Any earlier arrival at the same place is right. Arrivals are numbered
        in the order in which they were made, which the robot knows by itself, so the numbers
        tell nothing of the truth; `most` is the number of arrivals on a tour less one.
        Anything else is an `InputError`.

    Observation space:
        With `observation="dict"` two parts, by default the same in one row: `arrivals`
        (most, features), for each earlier arrival what tells whether it was here
        (`albot_env.tasks.place_recognition.spaces.FEATURES`), and `mask` (most,), which of them
        there are. All float32 in [-1, 1]. They are a function of the readings alone.

    Rewards:
        The sum of the terms of `PlaceRecognitionWeights`; each stands in `info["reward_terms"]`.

    Starting state:
        At the second arrival of a tour. World and start are drawn, or chosen by `options`, as in
        `Albot/Explore-v0`; the start is where the tour begins. `journeys` says from how many
        tours from that start one is drawn. Each is made when it is first asked for, which takes
        a second or two, and the last 256 MiB of them are kept. A tour is a function of its
        world, start and number alone.

    Episode end:
        Terminated when the last arrival is judged; the observation then is empty. A success is
        to have known `PlaceRecognitionConfig.recall` (85 %) of the places revisited and none
        falsely.

    Info:
        The truth, for evaluation: `world`, `room`, `pose`, `start`, `belief`, `position_error`,
        `collided`, `path_length`, `time` as in `Albot/Explore-v0`; `arrivals` (how many there
        were), `right_answer` (the latest earlier arrival at this place, or 0), how many answers
        were `right_known`, `right_new`, `false_known` (named a wrong arrival) or `missed` (said
        new of a known one), `revisits` (how many of the places judged were known), `precision`,
        `recall`, `is_success`, `reward_terms`.

    Args:
        world: A world spec, a world, or worlds (see `albot_maps.load_worlds`), with two
            rooms or more each.
        journeys: How many tours there are from a start, of which each reset draws one; 0 for a
            new one each time.
        config: Where tours lead, what is rewarded, and what is a success.
        settings: See `Settings`; and `render_mode`.

    Raises:
        InputError: As for `SingleEnv`; or there are fewer journeys than none. A reset raises
            one where the world has no two rooms in which a robot can stop.
    """

    task = PlaceRecognitionTask


class PlaceRecognitionVectorEnv(VectorEnv[PlaceRecognitionTask]):
    """Robots that judge where they are, each as in a `PlaceRecognitionEnv`. They share tours.

    See there for everything, and `VectorEnv` for what it takes besides.
    """

    task = PlaceRecognitionTask
