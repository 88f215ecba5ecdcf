"""Types of arguments."""

from __future__ import annotations

from typing import TypedDict

import numpy.typing as npt


class Camera(TypedDict, total=False):
    """A depth camera: ``K`` [3, 3] and ``world_from_camera`` [4, 4] are needed.

    ``masks`` [T, H, W] are true where the object is. ``depth_scale`` (m per count) and ``depth_offset`` [m] belong to depths that are counts.
    """

    name: str
    K: npt.ArrayLike
    world_from_camera: npt.ArrayLike
    distortion: npt.ArrayLike
    depth_scale: float
    depth_offset: float
    noise_sigma: float
    noise_systematic: float
    masks: npt.ArrayLike
