"""`albot map`: run a mapper over a real robot's log or a recorded episode."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from albot_cli import completion
from albot_cli.bag_options import bag_options
from albot_cli.error_report import errors_csv, errors_figure, errors_markdown
from albot_cli.map_report import (
    RECOGNITION,
    Score,
    as_table,
    check_moments,
    draw_recognition,
    is_stamped,
    notes_of,
    recognition_figures,
    report,
    score,
)
from albot_cli.mappers import mapper_config_option, read_mapper_config
from albot_cli.mapping_run import MappingRun, run_mapper, warm_up
from albot_cli.outputs import FORCE, JSON, FigureFile, check_folder, figure_options, filled_folder
from albot_cli.path_type import PathType
from albot_cli.progress import progress
from albot_core.drawing.figure import save_figure
from albot_core.errors import InputError
from albot_core.evaluation.trajectory import Trajectory, alignment, read_relations
from albot_core.export.g2o import write_g2o
from albot_core.export.geojson import write_geojson
from albot_core.export.graphml import write_graphml
from albot_core.export.map_server import write_map_server
from albot_core.export.picture import Panel, map_figure
from albot_core.export.tum import write_tum
from albot_core.files import write_text
from albot_core.geometry.poses import compose
from albot_core.localisation.mapper import MapUser
from albot_core.localisation.saved_maps import mapper_of
from albot_core.logs.example import EXAMPLE
from albot_core.logs.log import Log
from albot_core.logs.reader import read_reference
from albot_core.logs.ros_bag import BagTopics
from albot_core.mappers.map_file import save_map
from albot_core.mappers.mapper import AttractorNetwork, PlaceMemory
from albot_core.mappers.registry import (
    check_sensors,
    mapper_names,
    mapper_spec,
)
from albot_core.maps.layers import OccupancyGridLayer
from albot_env.recording.log import read_log_or_episode

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FILE = PathType()
TRAJECTORY, SURFACES, PICTURE, MAP = "trajectory.tum", "surfaces.geojson", "map.png", "map.albot"
NETWORK, EVENTS, CORRECTED = "network.graphml", "events.txt", "corrected.tum"
POSE_GRAPH = "network.g2o"
GRID, GRID_PICTURE = "grid.yaml", "grid.pgm"
ERRORS, ERROR_TABLE, ERROR_PICTURE = "errors.csv", "errors.md", "errors.png"
FILES = (
    TRAJECTORY,
    SURFACES,
    PICTURE,
    MAP,
    NETWORK,
    POSE_GRAPH,
    GRID,
    GRID_PICTURE,
    EVENTS,
    CORRECTED,
    RECOGNITION,
    ERRORS,
    ERROR_TABLE,
    ERROR_PICTURE,
)
"""Names of the files that `--out` writes."""


@click.command()
@click.argument("log", metavar="[LOG|EPISODE]", type=_FILE, default=EXAMPLE)
@click.option(
    "--mapper",
    default="albot1",
    show_default=True,
    shell_complete=completion.mapper_names,
    help=f"{', '.join(mapper_names())}.",
)
@mapper_config_option
@click.option(
    "--reference",
    type=_FILE,
    help="Where the robot was: a TUM trajectory, a JSON log, or a CARMEN log of corrected "
    "poses. A log that holds its own reference needs none.",
)
@click.option("--relations", type=_FILE, help="True relations between poses (Kümmerle et al.).")
@click.option(
    "--out",
    type=_FILE,
    help="Folder for the trajectory, surfaces, picture and map and, with a reference, the errors "
    "over time: a table, a CSV file and a picture.",
)
@click.option(
    "--recognition",
    is_flag=True,
    help="Also measure place recognition; needs a reference, and takes about a minute.",
)
@click.option(
    "--localise",
    metavar="MAPFILE",
    type=_FILE,
    help="Localise the robot in this map, of an earlier run's --out, from wherever the log begins. "
    "The mapper is the map's.",
)
@click.option(
    "--extend",
    is_flag=True,
    help="With --localise: go on mapping once the robot is localised.  [default: frozen map]",
)
@click.option("--keep-going", is_flag=True, help="Leave out the damaged lines of a log.")
@bag_options
@figure_options("the map")
@FORCE
@JSON
def command(
    log: Path,
    mapper: str,
    mapper_config: Path | None,
    reference: Path | None,
    relations: Path | None,
    out: Path | None,
    recognition: bool,
    localise: Path | None,
    extend: bool,
    keep_going: bool,
    topics: BagTopics | None,
    figure: FigureFile | None,
    force: bool,
    as_json: bool,
) -> None:
    """Run a mapper over a real robot's LOG or a recorded EPISODE, and report its errors.

    LOG is a CARMEN, Wean Hall, Duke or JSON log, compressed (.gz, .xz) or not, or a bag of ROS 1 or
    ROS 2 (.bag, .mcap, .db3, or a folder with metadata.yaml); EPISODE is a file of `albot play`
    (.mcap), which holds its own reference. The seconds reported are those of the mapper's updates
    alone, without compilation.

    With --localise the robot may begin anywhere in an earlier map: several poses are weighed until
    a second look, from elsewhere, decides. Errors are those of the scans at which the robot was
    localised, and the map's frame is the earlier one's.

    Without a log it maps a small log that comes with the project, of a simulated robot in an
    office.
    """
    if extend and localise is None:
        raise InputError("--extend", "--localise MAPFILE, a map to extend", "none")
    if localise is not None and not _is_given("mapper"):
        mapper = mapper_of(localise)
    spec = mapper_spec(mapper)
    mapper_parameters = read_mapper_config(spec, mapper_config)
    if localise is not None and mapper_config is None:
        mapper_parameters = None
    if out is not None:
        check_folder(out, FILES, force=force, figure=figure)
    recorded = read_log_or_episode(log, keep_going, topics)
    truth = read_reference(reference) if reference else recorded.reference_trajectory
    true_relations = read_relations(relations) if relations else None
    odometry = score(recorded.odometry_trajectory, truth, true_relations)
    check_moments(recorded, truth, odometry, reference, relations)
    known = truth if truth is not None and is_stamped(recorded, truth) else None
    if recognition and known is None:
        expected = "a reference of where the robot was at every scan"
        some = "one with fewer poses, or with scans whose stamps are not their own"
        raise InputError("--recognition", expected, "none" if truth is None else some)
    check_sensors(spec, recorded.sensors, recorded.name)
    notes = notes_of(recorded, truth, reference, true_relations)
    for note in notes:
        click.echo(f"albot: {recorded.name}: {note}", err=True)
    saved: dict[str, Any] = {"saved_map": localise, "extend": extend}
    warm_up(mapper, mapper_parameters, recorded, **saved)
    with progress(f"{mapper} on {recorded.name}", len(recorded.readings), "scans") as update:
        run = run_mapper(mapper, mapper_parameters, recorded, update, **saved)
    mapped = score(run.located, truth, true_relations)
    corrected = None if run.corrected is None else score(run.corrected, truth, true_relations)
    figures = report(recorded, run, mapped, corrected, odometry, notes)
    if recognition and known is not None:
        figures["recognition"] = recognition_figures(recorded, known, run.believed)
    title = f"{mapper} on {recorded.name}"
    scores = {mapper: mapped, **({"corrected": corrected} if corrected else {})}
    scores |= {} if recorded.is_odometry_constant else {"odometer": odometry}
    figures["files"] = None
    if out or figure:
        drawn = _draw(title, run, truth)
        files = write_files(out, title, run, drawn, recorded, scores) if out else {}
        figures["files"] = files | ({"figure": str(figure.save(drawn))} if figure else {})
    if out and figures.get("recognition"):
        figures["files"]["recognition"] = draw_recognition(out, title, figures["recognition"])
    click.echo(json.dumps(figures) if as_json else as_table(figures))


def _is_given(option: str) -> bool:
    """Return whether the user has given an option of the command."""
    source = click.get_current_context().get_parameter_source(option)
    return source is not ParameterSource.DEFAULT


def write_files(
    folder: Path,
    title: str,
    run: MappingRun,
    drawn: Figure,
    log: Log,
    scores: Mapping[str, Score],
) -> dict[str, str]:
    """Write trajectory, surfaces, picture and map; return the paths by kind of file.

    The network, the events, the grid and the corrected trajectory are written too if the mapper has
    them, and the errors if any of `scores` has them. The folder's files are replaced only when all
    are complete.
    """
    names = {"trajectory": TRAJECTORY, "surfaces": SURFACES, "picture": PICTURE, "map": MAP}
    with filled_folder(folder) as scratch:
        write_tum(run.located, scratch / TRAJECTORY)
        if run.corrected is not None:
            write_tum(run.corrected, scratch / CORRECTED)
            names["corrected"] = CORRECTED
        snapshot = run.mapper.snapshot()
        write_geojson(snapshot, scratch / SURFACES)
        if snapshot.place_graph.nodes:
            write_graphml(snapshot.place_graph, scratch / NETWORK)
            write_g2o(snapshot.place_graph, scratch / POSE_GRAPH)
            names |= {"network": NETWORK, "pose_graph": POSE_GRAPH}
        grid = snapshot.layer(OccupancyGridLayer)
        if grid is not None and grid.occupancy.size:
            write_map_server(grid, scratch / GRID)
            names |= {"grid": GRID, "grid_picture": GRID_PICTURE}
        if isinstance(run.mapper, PlaceMemory):
            write_text(scratch / EVENTS, "".join(f"{event}\n" for event in run.mapper.events))
            names["events"] = EVENTS
        used = run.mapper
        save_map(used.saved if isinstance(used, MapUser) else used, scratch / MAP)
        if any(score.positions is not None for score in scores.values()):
            write_text(scratch / ERRORS, errors_csv(log, scores))
            write_text(scratch / ERROR_TABLE, errors_markdown(scores))
            save_figure(errors_figure(title, log, scores), scratch / ERROR_PICTURE)
            names |= {"errors": ERRORS, "error_table": ERROR_TABLE, "error_picture": ERROR_PICTURE}
        save_figure(drawn, scratch / PICTURE)
    return {kind: str(folder / name) for kind, name in names.items()}


def _draw(title: str, run: MappingRun, reference: Trajectory | None) -> Figure:
    """Return the picture of the map, with the reference trajectory aligned to the estimated one."""
    frame = None if reference is None else alignment(reference, run.located)
    network = None
    if run.packets is not None and isinstance(run.mapper, AttractorNetwork):
        network = run.mapper.activity, run.packets
    laid = None if reference is None or frame is None else compose(frame, reference.poses)
    return map_figure(Panel(title, run.mapper.snapshot(), run.located.poses, laid), network)
