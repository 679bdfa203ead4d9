"""Association-1 on one journey: the map keeps its shape where plain integration loses it."""

from __future__ import annotations

from albot_experiments import association_1 as experiment
from albot_maps import load_world


def test_the_shape_is_kept_where_plain_integration_loses_it() -> None:
    world = load_world(experiment.WORLD)
    journey = experiment.drive(world, "poor", 1)
    assert 125 < journey.path_length < 140
    ours, plain = (
        experiment.follow(name, journey, world).shape for name in ("association", "odometry")
    )
    assert ours.path_error < 0.4
    assert ours.precision > 0.9
    assert plain.path_error > experiment.RATIO * ours.path_error
