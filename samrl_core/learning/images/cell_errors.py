"""What a corrected cell may still be wrong by, drawn from its correction's posterior for training images.

The picture of a camera that stands a little elsewhere is one of all the pictures that training takes anyway.
What differs in the cell is where the calibration puts its points: XYZ is moved, in depth along the rays too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from samrl_core.cell.calibration.cell_correction import CellCorrection
from samrl_core.cell.calibration.seen_error import SEEN_ROWS, seen_map, shifted
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.types.pose import Pose
from samrl_core.model.model import CameraPose


@dataclass(frozen=True, eq=False)
class CellErrors:
    """Of B images, each of a cell of its own."""

    correction: CellCorrection
    values: np.ndarray  # (B, K) of the numbers of its covariance

    @staticmethod
    def draw_cells(correction: CellCorrection, rng: np.random.Generator, count: int) -> CellErrors:
        """So many cells from the correction's covariance; all alike where it is known exactly."""
        known = correction.covariance
        return CellErrors(correction, rng.standard_normal((count, len(known.of))) @ known.factor.T)

    def rows(self, which: np.ndarray | slice) -> CellErrors:
        """Some of the cells."""
        return CellErrors(self.correction, self.values[which])

    def moved(self, xyz: torch.Tensor, camera: CameraPose, cell: CellSpec) -> torch.Tensor:
        """Where the points are seen; what shows nothing is of no use before and after.

        Args:
            xyz: (B, H, W, 3) in world [m].
            camera: world-to-camera rotations (B, 3, 3) and translations (B, 3) [m].
            cell: as described.
        """
        if not self.values.shape[1]:
            return xyz
        turns, ways = (part.cpu().numpy() for part in camera)
        poses = [Pose.from_rotation(-r.T @ t, r.T) for r, t in zip(turns, ways, strict=True)]
        errors = np.stack(
            [seen_map(self.correction, cell, pose) @ v for pose, v in zip(poses, self.values, strict=True)]
        )
        of_row = torch.from_numpy(errors).to(xyz).T[..., None, None]  # (16, B, 1, 1)
        turn, way = (part.to(xyz) for part in camera)
        x, y, z = (torch.einsum("bhwi,bji->bhwj", xyz, turn) + way[:, None, None]).unbind(-1)
        z = z.clamp_min(1e-3)  # pixels that show nothing have no ray
        moved = shifted(dict(zip(SEEN_ROWS, of_row, strict=True)), x, y, z, cell.intrinsics, self.correction)
        return xyz + torch.einsum("bhwj,bji->bhwi", torch.stack(moved, dim=-1), turn)
