"""How points on the target move with the parameters, without a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

# Places along a link's centre line, as shares of its length, by which a point finds its link.
ALONG = np.array([0.1, 0.3, 0.5, 0.7, 0.9])


@dataclass(frozen=True, eq=False)
class TargetPart:
    """What of the target has one label, and so is told apart in a mask."""

    label: int
    frames: frozenset[str]  # bodies, or the chain's frame
    is_chain: bool
    vertices: torch.Tensor  # (V,) float32, 1 on its vertices, else 0
    faces: np.ndarray  # (F, 3) its triangles
    groups: np.ndarray  # (K,) its colour groups
    parameters: np.ndarray  # (Q,) which of the task's parameters move it in the image
    own: np.ndarray  # (Q,) bool, which of these move no other part


@dataclass(frozen=True, eq=False)
class Reach:
    """A ball that holds all of a chain, however it hangs."""

    center: np.ndarray  # (3,) in world [m]
    radius: float  # [m]


@dataclass(frozen=True, eq=False)
class TargetFrames:
    """The F frames that the target's parts are fixed to: bodies first, then links of the chain."""

    rows: np.ndarray  # (F, 12) rotation by rows, then position in world [m]
    jacobians: np.ndarray  # (F, 12, P) of `rows` by the parameters
    anchors: np.ndarray  # (M, 3) points of each part, in its frame; other points belong to the nearest [m]
    anchor_frame: np.ndarray  # (M,) which frame
    stretched: bool = False  # axes of frames may have another length than 1

    def frame_of(self, points: np.ndarray) -> np.ndarray:
        """Which frame each point (N, 3) [m] belongs to, that of the nearest anchor, (N,)."""
        if len(self.rows) == 1:
            return np.zeros(len(points), dtype=np.int64)
        turn = self.rows[:, :9].reshape(-1, 3, 3)[self.anchor_frame]
        anchors = np.einsum("mij,mj->mi", turn, self.anchors) + self.rows[self.anchor_frame, 9:]
        squared = np.square(points[:, None] - anchors[None]).sum(axis=-1)
        return self.anchor_frame[np.argmin(squared, axis=1)]

    @property
    def points(self) -> np.ndarray:
        """The anchors (M, 3) in world [m]."""
        turn = self.rows[:, :9].reshape(-1, 3, 3)[self.anchor_frame]
        return np.einsum("mij,mj->mi", turn, self.anchors) + self.rows[self.anchor_frame, 9:]

    def motion(self, points: np.ndarray) -> np.ndarray:
        """How points (N, 3) of the target move with the parameters, (N, 3, P) [m per unit].

        The points are taken as fixed to their part: what the image shows at a fixed pixel of a flat face
        does not change when the face slides along itself, but the cloud as a whole moves.
        """
        frame = self.frame_of(points)
        turn = self.rows[:, :9].reshape(-1, 3, 3)[frame]
        local = np.einsum("nji,nj->ni", turn, points - self.rows[frame, 9:])
        if self.stretched:
            local /= np.square(turn).sum(axis=1)
        jacobians = self.jacobians[frame]
        turning = jacobians[:, :9].reshape(len(points), 3, 3, -1)
        return np.einsum("nijp,nj->nip", turning, local) + jacobians[:, 9:]
