"""`samrl excite --set camera`: recordings of the cell's camera from views that tell most."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from samrl_core.cell.excitation.camera_views import camera_motion
from samrl_core.cell.robots.arm_model import nominal_payloads
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.tasks import task_named
from samrl_core.cell.world import make_world
from samrl_core.cell.world.camera_recording import record_camera
from samrl_core.common.errors import InputError

LETTERS = "ABC"  # C is held out: its views are drawn, not chosen
LEAST_S = 6.0


def record_views(
    task_name: str, cell_name: str, world: str, seed: int, duration_s: float, out: Path,
    progress: Callable[[str], None] = lambda _: None,
) -> list[tuple[Path, float]]:  # fmt: skip
    """Record A, B and C; each bag with the information [nat] that its views were expected to add.

    The views of A and B are chosen one after the other, each among six within reach, by what the model's own
    rendering from there would add to those before. The object stands in all three where it stands first.

    Raises:
        InputError: too short, a task without a single rigid target, or a bag that exists.
    """
    from samrl_core.diagnosis.residuals.images.expected import ViewInformation  # loads torch
    from samrl_ros.recordings.write_images import write_image_bag

    if duration_s < LEAST_S:
        raise InputError(
            f"--duration {duration_s:g} s is too short for three views; give {LEAST_S:g} s or more"
        )
    paths = {letter: out / f"{letter}.mcap" for letter in LETTERS}
    for path in paths.values():
        if path.exists():
            raise InputError(f"{path} exists; choose another --out or move it away")
    task, cell = task_named(task_name), cell_named(cell_name)
    loads = nominal_payloads(cell, task.scene(cell).tool)
    worth, made = ViewInformation(task_name, cell_name, task.start_joints(cell)), []
    for k, (letter, path) in enumerate(paths.items()):
        progress(f"{letter}: choosing views")
        before, chooses = worth.nat, worth if letter != "C" else None
        motion = camera_motion(task, cell, loads, 3 * seed + k, duration_s, worth=chooses)
        progress(f"{letter}: recording")
        simulated = make_world(world, task, cell)
        try:
            simulated.reset(seed)
            recording = record_camera(simulated, task_name, cell, motion, letter)
        finally:
            simulated.close()
        progress(f"{letter}: writing")
        made.append((write_image_bag(recording, path), worth.nat - before))
    return made
