"""A body on the cell's table, photographed from anywhere: readings for building a first model."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
import pybullet

from samrl_core.cell.types.camera import Camera
from samrl_core.cell.types.observation import Frame
from samrl_core.cell.types.scene import Body
from samrl_core.cell.world.pybullet.bodies import PyBulletBodies
from samrl_core.cell.world.pybullet.camera import Picture, TinyCamera
from samrl_core.cell.world.sensor_noise import RgbdSensor
from samrl_core.cell.world.settings import WorldSettings
from samrl_core.cell.world.table import build_table


class BodyPhotos:
    """A physics client of its own with a table and one body, without arms; nothing moves in it.

    Args:
        body: placed at its nominal pose.
        settings: light and sensor noise; None for the cell's.

    Raises:
        InputError: the body cannot be built.
    """

    def __init__(self, body: Body, settings: WorldSettings | None = None) -> None:
        """Build table and body."""
        self._settings = settings or WorldSettings()
        self._client = pybullet.connect(pybullet.DIRECT)
        self._closed = False
        build_table(self._client, solid=False)
        with tempfile.TemporaryDirectory(prefix="samrl_photos_") as folder:
            try:
                bodies = PyBulletBodies(self._client, (body,), Path(folder), self._settings)
            except BaseException:
                self.close()
                raise
        bodies.place({body.name: body.body_in_world})
        self._labels = {(bodies.index[body.name], -1): body.label}

    def perfect(self, camera: Camera) -> Picture:
        """What a camera without noise would see; for evaluation."""
        s = self._settings
        tiny = TinyCamera(self._client, camera.intrinsics, self._labels, s.light_direction, s.shadow)
        return tiny.render(camera.camera_in_world)

    def read(self, camera: Camera, rng: np.random.Generator) -> Frame:
        """What the cell's camera reads, with its noise sampled from `rng`; the stamp is 0."""
        picture = self.perfect(camera)
        sensor = RgbdSensor(self._settings.rgbd_noise, camera.intrinsics)
        color, depth, mask = sensor.read(rng, picture.color, picture.depth, picture.mask)
        return Frame(0, color, depth, mask)

    def close(self) -> None:
        """Disconnect; twice is harmless."""
        if not self._closed:
            self._closed = True
            pybullet.disconnect(physicsClientId=self._client)
