"""The files that `albot map --out` leaves: all of them, or none."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

from albot_cli.mapping_run import MappingRun
from albot_core.evaluation.trajectory import Trajectory, alignment
from albot_core.export.geojson import write_geojson
from albot_core.export.graphml import write_graphml
from albot_core.export.picture import write_picture
from albot_core.export.tum import write_tum
from albot_core.files import write_text
from albot_core.geometry.poses import compose
from albot_core.mappers.map_file import save_map
from albot_core.mappers.mapper import PlaceMemory

TRAJECTORY, SURFACES, PICTURE, MAP = "trajectory.tum", "surfaces.geojson", "map.png", "map.albot"
NETWORK, EVENTS = "network.graphml", "events.txt"


def write_files(
    folder: Path, title: str, run: MappingRun, reference: Trajectory | None
) -> dict[str, str]:
    """Write trajectory, surfaces, picture and map; return their paths by kind.

    Of a mapper that knows places the network and its events are written as well. All
    are written to a hidden folder, and moved over when they are whole.
    """
    # Inside the folder where there is one: what is around it may not be ours to write to.
    around = folder if folder.exists() else folder.parent
    around.mkdir(parents=True, exist_ok=True)
    beside = Path(tempfile.mkdtemp(dir=around, prefix=f".{folder.name}."))
    names = {"trajectory": TRAJECTORY, "surfaces": SURFACES, "picture": PICTURE, "map": MAP}
    try:
        write_tum(run.believed, beside / TRAJECTORY)
        snapshot = run.mapper.snapshot()
        write_geojson(snapshot, beside / SURFACES)
        if snapshot.place_graph.nodes:
            write_graphml(snapshot.place_graph, beside / NETWORK)
            names["network"] = NETWORK
        if isinstance(run.mapper, PlaceMemory):
            write_text(beside / EVENTS, "".join(f"{event}\n" for event in run.mapper.events))
            names["events"] = EVENTS
        save_map(run.mapper, beside / MAP)
        _draw(beside / PICTURE, title, run, reference)
        folder.mkdir(exist_ok=True)
        for path in sorted(beside.iterdir()):
            path.replace(folder / path.name)
    finally:
        shutil.rmtree(beside)
    return {kind: str(folder / name) for kind, name in names.items()}


def _draw(path: Path, title: str, run: MappingRun, reference: Trajectory | None) -> None:
    """Draw the map, and the reference laid on the believed path as well as it goes."""
    frame = None if reference is None else alignment(reference, run.believed)
    write_picture(
        path,
        title=title,
        snapshot=run.mapper.snapshot(),
        believed=run.believed.poses,
        reference=None if reference is None or frame is None else compose(frame, reference.poses),
    )
