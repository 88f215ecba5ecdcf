from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, Callable, Literal, Optional, Union, final

import numpy as np
import numpy.typing as npt

from ._types import Camera as Camera

__version__: str

_Floats = npt.NDArray[np.float64]
_Whole = npt.NDArray[np.uint32]
_Path = Union[str, PathLike[str]]
_Backend = Literal["auto", "cpu", "gpu"]
_Cost = Literal["sparse-surface", "markers", "points", "displacements"]
_Optimizer = Literal["gauss-newton", "gauss-newton-cg", "lbfgs", "rprop", "gradient-descent", "nelder-mead"]
_Listener = Callable[["Progress"], object]

class PalpateError(Exception):
    """Something went wrong; the message says what, where, and what is allowed or may help."""

    file: Optional[str]
    line: Optional[int]
    key: Optional[str]
    hint: Optional[str]
    def __init__(
        self,
        message: str,
        file: Optional[str] = None,
        line: Optional[int] = None,
        key: Optional[str] = None,
        hint: Optional[str] = None,
    ) -> None: ...

class SceneError(PalpateError, ValueError):
    """Something is wrong with a scene, or with a file that it names."""

class RecordingError(PalpateError, ValueError):
    """Something is wrong with a recording."""

class ArgumentError(PalpateError, ValueError):
    """An argument is wrong; ``key`` is its name."""

class ComputationError(PalpateError, RuntimeError):
    """The input is fine, but the computation failed."""

class SimulationError(ComputationError):
    """A simulation failed; ``time`` [s] says when, where it had begun."""

    time: Optional[float]
    def __init__(self, message: str, time: Optional[float] = None, **attributes: Any) -> None: ...

class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a fit; ``result`` is the best so far, or None where there was nothing yet."""

    result: Optional[Fit]
    def __init__(self, result: Optional[Fit] = None) -> None: ...

@final
class Progress:
    """What a computation says of its progress."""

    @property
    def what(self) -> Literal["simulate", "fit", "diagnose", "track"]: ...
    @property
    def done(self) -> Optional[int]: ...
    @property
    def total(self) -> Optional[int]: ...
    @property
    def message(self) -> str: ...
    @property
    def start(self) -> Optional[int]: ...
    @property
    def iteration(self) -> Optional[int]: ...
    @property
    def cost(self) -> Optional[float]: ...
    @property
    def values(self) -> Optional[list[float]]: ...

@final
class Parameter:
    """A number of a scene that can be set and fitted."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def value(self) -> float: ...
    @property
    def limits(self) -> tuple[float, float]: ...
    @property
    def doc(self) -> str: ...
    @property
    def free(self) -> bool: ...
    @property
    def start(self) -> Optional[tuple[float, float]]: ...
    @property
    def bounds(self) -> Optional[tuple[float, float]]: ...
    @property
    def known(self) -> Optional[tuple[float, float]]: ...

@final
class Recording:
    """Everything that was measured of one object."""

    @staticmethod
    def open(path: _Path) -> Recording:
        """Reads a recording: its folder, or a TOML file of the format."""
    @staticmethod
    def from_arrays(
        times: npt.ArrayLike,
        *,
        points: Optional[npt.ArrayLike] = None,
        rest: Optional[npt.ArrayLike] = None,
        tolerance: Optional[float] = None,
        markers: Optional[npt.ArrayLike] = None,
        marker_names: Optional[Sequence[str]] = None,
        marker_rest: Optional[npt.ArrayLike] = None,
        marker_surface: Optional[npt.ArrayLike] = None,
        displacements: Optional[npt.ArrayLike] = None,
        nodes: Optional[npt.ArrayLike] = None,
        depth: Optional[npt.ArrayLike] = None,
        camera: Optional[Camera] = None,
        noise_sigma: Optional[float] = None,
        noise_systematic: float = 0.0,
        title: str = "",
        source: str = "arrays",
    ) -> Recording:
        """A recording of what was seen at ``times`` [T]; metres and seconds, NaN where a thing was not seen.

        points [T, N, 3] are tracked points of the body, which lie at rest [N, 3] while it rests, at most tolerance [m] from its surface;
        markers [T, M, 3] have marker_rest [M, 3], and marker_surface [M, 3] where they are fixed to the surface;
        displacements [T, N, 3] are those of the scene's nodes [N, 3];
        depth [T, H, W] of one camera is in metres (NaN or 0: no reading), or in counts (whole numbers, 0: no reading).
        noise_sigma [m] is the standard deviation of one coordinate or depth, noise_systematic [m] the size of errors that do not average out.
        """
    def with_camera(self, times: npt.ArrayLike, depth: npt.ArrayLike, camera: Camera) -> Recording:
        """The recording with the images of one more depth camera."""
    def save(self, folder: _Path) -> None:
        """Writes the recording as a folder, which the command line reads."""
    @property
    def kinds(self) -> list[_Cost]: ...
    @property
    def title(self) -> str: ...
    @property
    def warnings(self) -> list[str]: ...

@final
class Scene:
    """What is known of an object, and what is to be found; with its recording, where there is one."""

    @staticmethod
    def open(path: _Path, *, recording: bool = True) -> Scene:
        """Reads a scene file and, unless ``recording`` is false, the recording that it names."""
    @staticmethod
    def from_toml(text: str, *, base: Optional[_Path] = None, name: str = "scene.toml") -> Scene:
        """A scene given as text. Relative paths in it start from the folder ``base``, or the present one; errors call it ``name``."""
    def with_values(self, values: Mapping[str, float]) -> Scene:
        """The scene with other values, by dotted path, in SI units."""
    def with_recording(self, recording: Recording, *, cost: Union[_Cost, Sequence[_Cost], None] = None) -> Scene:
        """The scene compared with another recording. ``cost`` says which of its readings count; None: what the scene says, or all."""
    def deform(self, displacement: npt.ArrayLike) -> _Floats:
        """Vertices of the surface [V, 3] at displacements of the nodes [N, 3] [m]."""
    def save(self, path: _Path) -> None:
        """Writes the scene's text, with paths that hold from the file's folder."""
    @property
    def path(self) -> PathLike[str]: ...
    @property
    def title(self) -> str: ...
    @property
    def text(self) -> str: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def chosen(self) -> list[tuple[str, float, str]]:
        """What the scene left open and was chosen for it: key, value in SI units, and why."""
    @property
    def parameters(self) -> list[Parameter]:
        """The numbers of the scene that can be set and fitted, those of fields left out."""
    @property
    def nodes(self) -> _Floats:
        """Nodes of the simulation at rest [m] [N, 3]."""
    @property
    def surface(self) -> _Floats:
        """Vertices of the surface at rest [m] [V, 3]."""
    @property
    def triangles(self) -> _Whole:
        """Triangles of the surface [T, 3]."""
    @property
    def mass(self) -> float:
        """Mass of the body [kg]."""
    @property
    def volume(self) -> float:
        """Volume of the body [m³]."""
    @property
    def frame_times(self) -> _Floats:
        """Times of the frames that are compared, on the recording's clock [s] [F]."""
    @property
    def recording(self) -> Optional[Recording]: ...

@final
class Residuals:
    """Readings R of a recording beside a simulation, in the order of the frames."""

    @property
    def sensors(self) -> list[str]:
        """Names of the sensors that took the readings: cameras, markers, "points", "nodes"."""
    @property
    def time(self) -> _Floats:
        """Time of each reading on the recording's clock [s] [R]."""
    @property
    def frame(self) -> _Whole:
        """Number of the frame [R]."""
    @property
    def sensor(self) -> _Whole:
        """Place of the sensor in ``sensors`` [R]."""
    @property
    def item(self) -> _Whole:
        """Number of the depth point in its frame, of the marker or point, of the node [R]."""
    @property
    def measured(self) -> _Floats:
        """Where it was measured [m] [R, 3]."""
    @property
    def simulated(self) -> _Floats:
        """Where the simulation has it [m] [R, 3]; NaN for depth, whose readings belong to no place of the body."""
    @property
    def distance(self) -> _Floats:
        """Distance [m] [R]: of depth from the surface, positive outside the body; of all else between both places. NaN: met nothing."""
    @property
    def rms(self) -> float:
        """Root mean square of the distances [m]; NaN without any."""
    def __len__(self) -> int: ...

@final
class Simulation:
    """All states of a simulation: F of them, with N nodes and V vertices of the surface."""

    @property
    def scene(self) -> Scene: ...
    @property
    def times(self) -> _Floats:
        """Times of the states on the recording's clock [s] [F]."""
    @property
    def nodes(self) -> _Floats:
        """Nodes at rest [m] [N, 3]."""
    @property
    def displacement(self) -> _Floats:
        """Displacements of the nodes [m] [F, N, 3]."""
    @property
    def velocity(self) -> _Floats:
        """Velocities of the nodes [m/s] [F, N, 3]."""
    @property
    def surface(self) -> _Floats:
        """Vertices of the surface in every state [m] [F, V, 3]."""
    @property
    def triangles(self) -> _Whole:
        """Triangles of the surface [T, 3]."""
    @property
    def residuals(self) -> Optional[Residuals]:
        """How far every reading of the scene's recording lies from this; None without a recording."""
    def __len__(self) -> int: ...

@final
class Fit:
    """A finished (or interrupted) fit."""

    @property
    def result(self) -> dict[str, Any]:
        """What the command line writes as ``result.json``."""
    @property
    def verdict(self) -> Literal["converged", "interrupted", "at-a-bound", "not-to-be-trusted"]: ...
    @property
    def reasons(self) -> list[str]:
        """Why, in sentences."""
    @property
    def values(self) -> dict[str, float]:
        """Values found, by path, in SI units."""
    @property
    def errors(self) -> dict[str, Optional[float]]:
        """Their standard errors, by path; None at a bound or where the data do not say."""
    @property
    def fields(self) -> dict[str, _Floats]:
        """Values of the fields found, by path [count]."""
    @property
    def history(self) -> dict[str, npt.NDArray[Any]]:
        """Every iteration of every start: run, iteration and cost [H], and values of what is free [H, q]."""
    @property
    def warnings(self) -> list[str]: ...
    @property
    def scene(self) -> Scene:
        """The scene with what was found; of several the first."""
    @property
    def scenes(self) -> list[Scene]:
        """The scenes with what was found."""
    def residuals(self) -> list[Residuals]:
        """How far every reading lies from the best simulation, scene by scene; it is simulated once more for that."""
    def save(self, folder: _Path, *, pictures: int = 24) -> None:
        """Writes what the command line writes: result.json, model.toml, history.csv, fields, and report.html."""

@final
class Diagnosis:
    """A finished diagnosis."""

    @property
    def result(self) -> dict[str, Any]:
        """What the command line writes as ``diagnosis.json``."""
    @property
    def found(self) -> list[str]:
        """Kinds of the effects that were found."""
    @property
    def scene(self) -> Optional[Scene]:
        """The corrected scene; of several the first."""
    @property
    def scenes(self) -> list[Scene]:
        """The corrected scenes."""

@final
class Track:
    """The moving body in F frames of a recording, with N nodes and V vertices of the surface."""

    @property
    def result(self) -> dict[str, Any]:
        """What the command line writes as ``tracked.json``: a verdict, and a row a frame."""
    @property
    def verdict(self) -> Literal["tracked", "doubtful"]: ...
    @property
    def times(self) -> _Floats:
        """Times of the frames on the recording's clock [s] [F]."""
    @property
    def nodes(self) -> _Floats:
        """Nodes at rest [m] [N, 3]."""
    @property
    def displacement(self) -> _Floats:
        """Displacements of the nodes [m] [F, N, 3]."""
    @property
    def velocity(self) -> _Floats:
        """Velocities of the nodes [m/s] [F, N, 3]."""
    @property
    def data(self) -> _Floats:
        """Share of the prior's variance that readings took away, by node [F, N]."""
    @property
    def rest(self) -> _Floats:
        """Vertices of the surface at rest [m] [V, 3]."""
    @property
    def surface(self) -> _Floats:
        """Vertices of the surface [m] [F, V, 3]."""
    @property
    def triangles(self) -> _Whole:
        """Triangles of the surface [T, 3]."""
    @property
    def sigma(self) -> _Floats:
        """Standard deviation of one coordinate of each vertex [m] [F, V]."""
    @property
    def seen(self) -> npt.NDArray[np.bool_]:
        """Whether each vertex was seen [F, V]."""
    def recording(self) -> Recording:
        """A recording of points of the surface where they were seen, for a fit."""
    def __len__(self) -> int: ...

class Problem:
    """What a fit of one or several scenes minimises, as a function of x [q]."""

    def __new__(cls, scene: Union[Scene, Sequence[Scene]], *, backend: _Backend = "auto", scaled: bool = False) -> Problem: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def units(self) -> list[str]: ...
    @property
    def scaled(self) -> bool: ...
    @property
    def x0(self) -> _Floats:
        """The scenes' own values as x [q]."""
    @property
    def bounds(self) -> list[tuple[float, float]]:
        """Lower and upper bound of each component of x, as SciPy takes them."""
    def values(self, x: npt.ArrayLike) -> _Floats:
        """Values in SI units [q] at x."""
    def coordinates(self, values: npt.ArrayLike) -> _Floats:
        """x at values in SI units [q]."""
    def __call__(self, x: npt.ArrayLike) -> float:
        """The cost at x."""
    def value(self, x: npt.ArrayLike) -> float:
        """The cost at x."""
    def gradient(self, x: npt.ArrayLike) -> _Floats:
        """The gradient of the cost at x [q]."""
    def value_and_gradient(self, x: npt.ArrayLike) -> tuple[float, _Floats]:
        """Cost and gradient at x, by one simulation; for ``scipy.optimize.minimize(..., jac=True)``."""
    def curvature(self, x: npt.ArrayLike) -> _Floats:
        """The Gauss–Newton approximation of the second derivatives at x [q, q]."""
    def torch(self) -> Callable[[Any], Any]:
        """The cost as a function of a tensor [q], through which PyTorch differentiates."""
    def check_gradient(self, x: npt.ArrayLike, *, step: float = 1e-4) -> float:
        """Largest difference between the gradient at x and central differences, over the gradient's largest component."""

def simulate(scene: Scene, *, backend: _Backend = "auto", progress: Union[bool, _Listener, None] = None) -> Simulation:
    """Simulates a scene with its own values and keeps every state."""

def fit(
    scene: Union[Scene, Sequence[Scene]],
    *,
    backend: _Backend = "auto",
    optimizer: Optional[_Optimizer] = None,
    iterations: Optional[int] = None,
    starts: Optional[int] = None,
    seed: Optional[int] = None,
    threads: Optional[int] = None,
    batch: Optional[int] = None,
    grid_check: bool = True,
    journal: Optional[_Path] = None,
    resume: bool = False,
    progress: Union[bool, _Listener, None] = None,
) -> Fit:
    """Finds the free parameters of a scene, or of several scenes that are fitted together."""

def diagnose(
    scene: Union[Scene, Sequence[Scene]],
    *,
    held_out: Optional[Scene] = None,
    budget: Optional[float] = None,
    backend: _Backend = "auto",
    progress: Union[bool, _Listener, None] = None,
) -> Diagnosis:
    """Finds out whether a model lacks something, where, and what; within ``budget`` minutes, where it is given."""

def track(scene: Scene, *, progress: Union[bool, _Listener, None] = None) -> Track:
    """Finds the moving body in every frame of the scene's recording, whatever moved it."""
