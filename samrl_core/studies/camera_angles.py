"""How well effects can be told apart and measured in images, by how the camera moves.

The model's own renderings of four motions of 18 s, no simulated world: `python -m
samrl_core.studies.camera_angles`.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from samrl_core.cell.excitation.camera_views import CameraMotion, camera_motion
from samrl_core.cell.robots.arm_model import ArmModel, nominal_payloads
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.robots.inverse_kinematics import solve_ik
from samrl_core.cell.robots.robot import CellSpec
from samrl_core.cell.tasks import task_named
from samrl_core.cell.tasks.task import Task
from samrl_core.cell.types.image_recording import ImageRecording
from samrl_core.cell.types.pose import look_at
from samrl_core.diagnosis.residuals.images.expected import (
    Parts,
    ViewInformation,
    expected_rows,
    expected_scene,
    smallest_angle,
    still_recording,
)

TASK = "peg_insertion"
SECONDS, FRAMES, SEED = 18.0, 24, 100
ORBIT_M, ORBIT_RAD = 0.34, 1.1  # distance and elevation of the camera on the orbit
ORBIT_ARC = (-0.3, -2.5)  # azimuths [rad] that the arm reaches one after the other
DOWN_M, DOWN_RAD = 0.40, 1.54  # the same of a camera that looks straight down
EVERY = 10  # of the commanded joints are kept
EFFECTS: dict[str, Parts] = {
    "hand-eye": ({"hand_eye": 1.0},),
    "base": ({"base": 1.0},),
    "camera arm's zeros": ({"camera_zeros": 1.0},),
    "intrinsics": ({"focal": 1.0}, {"centre": 1.0}),
    "depth scale": ({"depth_scale": 1.0},),
    "depth offset": ({"depth_offset": 1.0},),
    "latency": ({"camera_late": 1.0, "tool_late": 1.0},),
    "camera arm's clock": ({"camera_late": -1.0},),
    "tool arm's clock": ({"tool_late": -1.0},),
}
PAIRS = (
    ("hand-eye", "base"),
    ("hand-eye", "camera arm's zeros"),
    ("intrinsics", "hand-eye"),
    ("depth scale", "depth offset"),
    ("latency", "tool arm's clock"),
    ("latency", "camera arm's clock"),
)


def angles(recording: ImageRecording) -> dict[tuple[str, str], float]:
    """Of each pair [deg]; NaN where an effect does nothing in these images."""
    scene = expected_scene(recording)
    times = np.linspace(0.3, SECONDS - 0.3, FRAMES)
    frames = [expected_rows(scene, recording, float(t)) for t in times]
    return {pair: smallest_angle(frames, EFFECTS[pair[0]], EFFECTS[pair[1]]) for pair in PAIRS}


def bounds(recording: ImageRecording) -> dict[str, float]:
    """Least standard deviations that the images' information allows, all else open as stated, by quantity."""
    task, cell = task_named(TASK), cell_named(DEFAULT_CELL)
    worth = ViewInformation(TASK, DEFAULT_CELL, task.start_joints(cell))
    for t in np.linspace(0.3, SECONDS - 0.3, FRAMES):
        worth.take({f"{arm}_arm": recording.joints_at(arm, float(t)) for arm in ("camera", "tool")})
    hand_eye = worth.deviations("hand_eye")
    return {
        "hand-eye [mm]": 1e3 * float(hand_eye[:3].max()),
        "hand-eye [deg]": float(np.degrees(hand_eye[3:].max())),
        "depth scale [%]": 100.0 * float(worth.deviations("depth_scale")[0]),
        "focal length [%]": 100.0 * float(worth.deviations("focal").max()),
        "image centre [%]": 100.0 * float(worth.deviations("centre").max()),
    }


def still_camera(task: Task, cell: CellSpec) -> ImageRecording:
    """The tool moves in sight, the camera stands."""
    return _recorded(task, cell, _motion(task, cell, camera_moves=False))


def orbit(task: Task, cell: CellSpec) -> ImageRecording:
    """The camera goes around at one distance, upright; the tool moves as for the still camera."""
    return _around(task, cell, ORBIT_M, ORBIT_RAD)


def straight_down(task: Task, cell: CellSpec) -> ImageRecording:
    """The camera turns above the object: the table is at one depth, the object's top at another."""
    return _around(task, cell, DOWN_M, DOWN_RAD)


def _around(task: Task, cell: CellSpec, distance_m: float, elevation_rad: float) -> ImageRecording:
    recording, region, start = still_camera(task, cell), task.view_region(), task.start_joints(cell)
    arm = ArmModel(cell.camera_arm, cell.camera_base_in_world, None)
    steps = np.linspace(*ORBIT_ARC, 25)
    flat, up = distance_m * np.cos(elevation_rad), distance_m * np.sin(elevation_rad)
    joints = [start["camera_arm"]]
    for azimuth in steps:
        eye = region.target + np.array([flat * np.cos(azimuth), flat * np.sin(azimuth), up])
        view = look_at(eye, region.target, 0.0)
        joints.append(solve_ik(arm, view @ cell.camera_in_flange.inverse(), joints[-1]))
    time = np.linspace(0.0, SECONDS, len(steps))
    return replace(recording, camera_joint_time=time, camera_joints=np.stack(joints[1:]))


def rolled_views(task: Task, cell: CellSpec) -> ImageRecording:
    """Twelve views near and far, rolled, in the order of their drawing."""
    return _recorded(task, cell, _motion(task, cell))


def chosen_views(task: Task, cell: CellSpec) -> ImageRecording:
    """As many, each chosen among six by expected information, as `samrl excite --set camera` does."""
    worth = ViewInformation(TASK, DEFAULT_CELL, task.start_joints(cell))
    return _recorded(task, cell, _motion(task, cell, worth))


MOTIONS: dict[str, Callable[[Task, CellSpec], ImageRecording]] = {
    "still camera": still_camera,
    "orbit": orbit,
    "straight down": straight_down,
    "rolled views": rolled_views,
    "chosen views": chosen_views,
}


def _motion(
    task: Task, cell: CellSpec, worth: ViewInformation | None = None, camera_moves: bool = True
) -> CameraMotion:
    tool = task.scene(cell).tool
    loads = nominal_payloads(cell, tool)
    return camera_motion(task, cell, loads, SEED, SECONDS, camera_moves=camera_moves, worth=worth)


def _recorded(task: Task, cell: CellSpec, motion: CameraMotion) -> ImageRecording:
    """What the joints would read, without images."""
    camera, tool = motion.camera_arm.position, motion.tool_arm.position
    assert camera is not None and tool is not None
    time = motion.time[::EVERY]
    return replace(
        still_recording(TASK, DEFAULT_CELL, task.start_joints(cell)),
        camera_joint_time=time,
        camera_joints=camera[::EVERY],
        tool_joint_time=time,
        tool_joints=tool[::EVERY],
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a line for each motion: angles, or bounds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bounds", action="store_true", help="standard deviations instead of angles")
    parser.add_argument("--only", nargs="*", choices=list(MOTIONS), help="motions")
    given = parser.parse_args(arguments)
    task, cell = task_named(TASK), cell_named(DEFAULT_CELL)
    if given.bounds:
        for name in given.only or MOTIONS:
            found = bounds(MOTIONS[name](task, cell))
            print(f"{name}: " + ", ".join(f"{what} {value:.2g}" for what, value in found.items()), flush=True)
        return
    print("| motion | " + " | ".join(f"{a}, {b}" for a, b in PAIRS) + " |")
    for name in given.only or MOTIONS:
        found = angles(MOTIONS[name](task, cell))
        shown = ("-" if np.isnan(found[pair]) else f"{found[pair]:.1f}" for pair in PAIRS)
        print(f"| {name} | " + " | ".join(shown) + " |", flush=True)


if __name__ == "__main__":
    main()
