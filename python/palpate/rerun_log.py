"""Motion for the Rerun viewer; needs the package ``rerun-sdk`` (``pip install palpate[rerun]``)."""

from __future__ import annotations

from typing import Any, Optional, Union

import numpy as np

from . import Residuals, Simulation, Track

#: Colour of the body, and of readings that it meets.
BODY = (115, 158, 217)
READING = (217, 95, 60)


def log(
    motion: Union[Simulation, Track],
    path: str = "palpate",
    *,
    residuals: Optional[Residuals] = None,
    timeline: str = "time",
    recording: Any = None,
) -> int:
    """Logs the surface of a simulation or of a tracked body, and the readings that it was compared with; returns the number of states.

    ``path`` is the entity under which all is logged: ``PATH/surface``, ``PATH/readings/SENSOR``, and ``PATH/rms`` [m] of every frame. ``residuals``
    are those of a simulation unless others are given. ``recording`` is a stream of Rerun; None: the present one.
    """
    import rerun as rr

    surface, triangles = motion.surface, motion.triangles
    for time, vertices in zip(motion.times, surface):
        rr.set_time(timeline, duration=float(time), recording=recording)
        mesh = rr.Mesh3D(
            vertex_positions=vertices,
            triangle_indices=triangles,
            vertex_normals=_normals(vertices, triangles),
            albedo_factor=BODY,
        )
        rr.log(f"{path}/surface", mesh, recording=recording)
    if residuals is None and isinstance(motion, Simulation):
        residuals = motion.residuals
    if residuals is not None:
        _log_readings(rr, residuals, path, timeline, recording)
    return len(surface)


def _log_readings(rr: Any, residuals: Residuals, path: str, timeline: str, recording: Any) -> None:
    frame, sensor, place = residuals.frame, residuals.sensor, residuals.measured
    for number in np.unique(frame):
        at = frame == number
        rr.set_time(timeline, duration=float(residuals.time[at][0]), recording=recording)
        for s in np.unique(sensor[at]):
            of = at & (sensor == s)
            points = rr.Points3D(place[of], colors=READING)
            rr.log(f"{path}/readings/{residuals.sensors[s]}", points, recording=recording)
    met = ~np.isnan(residuals.distance)
    for number in np.unique(frame[met]):
        at = met & (frame == number)
        rr.set_time(timeline, duration=float(residuals.time[at][0]), recording=recording)
        rms = float(np.sqrt(np.mean(residuals.distance[at] ** 2)))
        rr.log(f"{path}/rms", rr.Scalars(rms), recording=recording)


def _normals(vertices: Any, triangles: Any) -> Any:
    """Unit normals of vertices [V, 3]: sums of those of their triangles, by area."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    of = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(normals, triangles[:, k], of)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0, length, 1.0)
