"""palpate fits the physics of soft bodies to measured motion.

>>> import palpate
>>> scene = palpate.Scene.open("assets/scenes/first-fit.toml")
>>> found = palpate.fit(scene)
>>> found.values["material.youngs_modulus"], found.errors["material.youngs_modulus"]

A *scene* says what is known of an object and what is to be found, a *recording* holds what was measured. Both come from files or from
arrays; everything is in SI units. docs/python.md shows the whole.
"""

from __future__ import annotations

from ._errors import (
    ArgumentError,
    ComputationError,
    Interrupted,
    PalpateError,
    RecordingError,
    SceneError,
    SimulationError,
)
from ._palpate import (
    Diagnosis,
    Fit,
    Parameter,
    Progress,
    Recording,
    Residuals,
    Scene,
    Simulation,
    Track,
    __version__,
)
from ._problem import Problem
from ._progress import diagnose, fit, simulate, track
from ._types import Camera

__all__ = [
    "ArgumentError",
    "Camera",
    "ComputationError",
    "Diagnosis",
    "Fit",
    "Interrupted",
    "PalpateError",
    "Parameter",
    "Problem",
    "Progress",
    "Recording",
    "RecordingError",
    "Residuals",
    "Scene",
    "SceneError",
    "Simulation",
    "SimulationError",
    "Track",
    "__version__",
    "diagnose",
    "fit",
    "simulate",
    "track",
]
