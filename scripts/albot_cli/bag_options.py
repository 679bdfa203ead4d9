"""The options `--scan` and `--odom` of commands that read logs."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

import click

_Command = TypeVar("_Command", bound=Callable[..., Any])


def bag_options(command: _Command) -> _Command:
    """Add the options to a command, which is given them as `topics`: None without either."""

    @wraps(command)
    def with_topics(*arguments: Any, scan: str | None, odom: str | None, **options: Any) -> Any:
        from albot_core.logs.ros_bag import BagTopics

        topics = None if scan is None and odom is None else BagTopics(scan=scan, odom=odom)
        return command(*arguments, topics=topics, **options)

    add_odom = click.option(
        "--odom",
        metavar="TOPIC",
        help="Topic of a ROS bag with the odometry or the transforms.  "
        "[default: the only one of odometry, or else of transforms]",
    )
    add_scan = click.option(
        "--scan",
        metavar="TOPIC",
        help="Topic of a ROS bag with the scans.  [default: the only one]",
    )
    return cast(_Command, add_scan(add_odom(with_topics)))
