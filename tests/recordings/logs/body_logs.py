"""Tracks of a body as other people's tools write them, with the traps of each format."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from samrl_core.cell.types.body_recording import BodyTrack

Writer = Callable[[Path, BodyTrack], Path]
Y_UP = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # Motive's frame in ours


def motive(path: Path, track: BodyTrack) -> Path:
    """Motive 1.23 with two rigid bodies, y up, millimetres, lost frames and frames beside time.

    Rows after docs.optitrack.com, Data Export: CSV, and public exports: types, names, IDs, kinds, axes, with
    a blank line above, and a column of the mean marker error of each body.
    """
    head = (
        "Format Version,1.23,Take Name,Take 1,Capture Frame Rate,120.000000,Export Frame Rate,120.000000,"
        f"Total Exported Frames,{len(track)},Rotation Type,Quaternion,Length Units,Millimeters,"
        "Coordinate Space,Global"
    )
    columns = [("Rotation", axis) for axis in "XYZW"] + [("Position", axis) for axis in "XYZ"]
    columns.append(("Mean Marker Error", ""))
    rows = [head, ""]
    for line in (
        ["Rigid Body"] * 16,
        [name for name in ("table", "cube") for _ in columns],
        [f'"{name}"' for name in ("4CF0", "9F12") for _ in columns],
        [kind for kind, _ in columns] * 2,
    ):
        rows.append(",".join(["", "", *line]))
    rows.append(",".join(["Frame", "Time (Seconds)", *([axis for _, axis in columns] * 2)]))
    turned = (Y_UP * Rotation.from_quat(track.quat_xyzw)).as_quat()
    position = 1e3 * Y_UP.apply(track.position)
    for k, time in enumerate(track.time):
        cells = [str(k), f"{time:.6f}", *["0.000000"] * 3, "1.000000", "250.0", "10.0", "-80.0", "0.2"]
        seen = [*turned[k], *position[k], 0.3]
        cells += [""] * 8 if 20 <= k < 24 else [f"{v:.6f}" for v in seen]
        rows.append(",".join(cells))
    return _write(path.with_suffix(".csv"), rows)


def motive_labelled(path: Path, track: BodyTrack) -> Path:
    """Motive 1.25: labelled rows with parents, a time code beside the time, markers after the body."""
    head = "Format Version,1.25,Take Name,Take 2,Rotation Type,Quaternion,Length Units,Meters"
    kinds = [("Rotation", axis) for axis in "XYZW"] + [("Position", axis) for axis in "XYZ"]
    marker = [("Position", axis) for axis in "XYZ"]
    rows = [head, ""]
    for label, body, mark in (
        ("Type", "Rigid Body", "Rigid Body Marker"), ("Name", "cube", "cube:Marker 001"),
        ("ID", "1", "2"), ("Parent", "", "1"),
    ):  # fmt: skip
        rows.append(",".join(["", label, "", *[body] * len(kinds), *[mark] * 3]))
    rows.append(",".join(["", "", "", *[kind for kind, _ in kinds], *[kind for kind, _ in marker]]))
    rows.append(",".join(["Frame", "Time (Seconds)", "TimeCode", *[a for _, a in kinds], *"XYZ"]))
    turned = (Y_UP * Rotation.from_quat(track.quat_xyzw)).as_quat()
    position = Y_UP.apply(track.position)
    for k, time in enumerate(track.time):
        seen = [*turned[k], *position[k], *(position[k] + 0.02)]
        rows.append(",".join([str(k), f"{time:.6f}", f"15:26:46:{k}", *[f"{v:.6f}" for v in seen]]))
    return _write(path.with_suffix(".csv"), rows)


def vicon(path: Path, track: BodyTrack) -> Path:
    """Vicon Tracker's objects as quaternions: a section's name, its rate, names, axes, units, and frames."""
    rate = 1.0 / float(np.median(np.diff(track.time)))
    rows = ["Objects", f"{rate:.6g}", ",,cube:cube,,,,,,", "Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ"]
    rows.append(",,,,,,mm,mm,mm")
    frames = 1001 + np.rint(rate * track.time).astype(int)
    for k, frame in enumerate(frames):
        seen = [*track.quat_xyzw[k], *(1e3 * track.position[k])]
        rows.append(",".join([str(frame), "0", *[f"{v:.6f}" for v in seen]]))
    return _write(path.with_suffix(".csv"), rows)


def _qualisys_head(track: BodyTrack, *, kind: str) -> list[str]:
    rate = 1.0 / float(np.median(np.diff(track.time)))
    return [
        f"NO_OF_FRAMES\t{len(track)}", "NO_OF_CAMERAS\t8", f"FREQUENCY\t{rate:.6g}", "NO_OF_ANALOG\t0",
        "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--", "TIME_STAMP\t2024-03-12, 14:22:31.112\t5520.10420",
        f"DATA_INCLUDED\t{kind}",
    ]  # fmt: skip


def qualisys_markers(path: Path, track: BodyTrack) -> Path:
    """Track Manager's TSV of two markers, neither frame nor time nor axes, a tab at each row's end."""
    rows = [*_qualisys_head(track, kind="3D"), "MARKER_NAMES\tground\tcube"]
    for k in range(len(track)):
        seen = (
            "0.000\t0.000\t0.000" if 20 <= k < 24 else "\t".join(f"{1e3 * v:.3f}" for v in track.position[k])
        )
        rows.append(f"250.000\t-80.000\t10.000\t{seen}\t")
    return _write(path.with_suffix(".tsv"), rows)


def qualisys_bodies(path: Path, track: BodyTrack) -> Path:
    """Its TSV of a rigid body: frame, time, position, angles, residual, and the matrix by columns."""
    rows = [*_qualisys_head(track, kind="6D"), "BODY_NAMES\tcube"]
    rows.append(
        "\t".join(
            ["Frame", "Time", *"XYZ", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9))]
        )
    )
    turns = Rotation.from_quat(track.quat_xyzw)
    angles, matrices = (
        turns.as_euler("XYZ", degrees=True),
        np.swapaxes(turns.as_matrix(), 1, 2).reshape(-1, 9),
    )
    for k, time in enumerate(track.time):
        seen = [*(1e3 * track.position[k]), *angles[k], 0.4, *matrices[k]]
        rows.append("\t".join([str(k + 1), f"{time:.5f}", *(f"{v:.6f}" for v in seen)]))
    return _write(path.with_suffix(".tsv"), rows)


def tum(path: Path, track: BodyTrack) -> Path:
    """TUM's trajectories: blanks, comments above, the last of which names the columns (vision.in.tum.de)."""
    rows = ["# ground truth trajectory", "# file: 'rgbd_dataset.bag'", "# timestamp tx ty tz qx qy qz qw"]
    for k, time in enumerate(track.time):
        seen = [*track.position[k], *track.quat_xyzw[k]]
        rows.append(" ".join([f"{1305031098.6659 + time:.4f}", *[f"{v:.6f}" for v in seen]]))
    return _write(path.with_suffix(".txt"), rows)


def euroc(path: Path, track: BodyTrack) -> Path:
    """EuRoC's ground truth: nanoseconds, units in brackets, w first, velocities and biases behind."""
    rows = [
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [],"
        " v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1],"
        " b_w_RS_S_y [rad s^-1], b_w_RS_S_z [rad s^-1]"
    ]
    for k, time in enumerate(track.time):
        seen = [*track.position[k], *track.quat_xyzw[k][[3, 0, 1, 2]], *np.full(6, 0.002)]
        rows.append(",".join([str(1403636580838555648 + round(1e9 * time)), *[f"{v:.6f}" for v in seen]]))
    return _write(path.with_suffix(".csv"), rows)


def ros_echo(path: Path, track: BodyTrack) -> Path:
    """`rostopic echo -p` of a stamped pose: when it was written stands before when it was seen."""
    names = [f"field.pose.position.{a}" for a in "xyz"] + [f"field.pose.orientation.{a}" for a in "xyzw"]
    rows = [",".join(["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id", *names])]
    late = 3_000_000 + 1_000_000 * np.random.default_rng(0).integers(0, 9, len(track))
    for k, time in enumerate(track.time):
        stamp = 1403636580838555648 + round(1e9 * time)
        seen = [*track.position[k], *track.quat_xyzw[k]]
        rows.append(
            ",".join([str(stamp + late[k]), str(k), str(stamp), "world", *[f"{v:.6f}" for v in seen]])
        )
    return _write(path.with_suffix(".csv"), rows)


def ros_seconds(path: Path, track: BodyTrack) -> Path:
    """A bag's messages as a table, as bagpy and PlotJuggler write them: a stamp in two columns."""
    names = [f"pose.position.{a}" for a in "xyz"] + [f"pose.orientation.{a}" for a in "xyzw"]
    rows = [",".join(["header.seq", "header.stamp.secs", "header.stamp.nsecs", *names])]
    for k, time in enumerate(track.time):
        stamp = 1_650_000_000_900_000_000 + round(1e9 * time)
        seen = [*track.position[k], *track.quat_xyzw[k]]
        rows.append(",".join([str(k), str(stamp // 10**9), str(stamp % 10**9), *[f"{v:.6f}" for v in seen]]))
    return _write(path.with_suffix(".csv"), rows)


def semicolons(path: Path, track: BodyTrack) -> Path:
    """A spreadsheet's export: semicolons, decimal commas, units in a row of their own, lines above."""
    rows = ["Messung 7", "", "Zeit;time;pos_x;pos_y;pos_z", ";s;cm;cm;cm"]
    for k, time in enumerate(track.time):
        seen = [f"{v:.5f}".replace(".", ",") for v in (time, *(100.0 * track.position[k]))]
        rows.append(";".join([str(k), *seen]))
    return _write(path.with_suffix(".csv"), rows)


def arrays(path: Path, track: BodyTrack) -> Path:
    """A script's NPZ: seconds, a position and a quaternion with w first, which no name says."""
    path = path.with_suffix(".npz")
    np.savez(path, t=track.time, pos=track.position, quat_wxyz=track.quat_xyzw[:, [3, 0, 1, 2]])
    return path


def _write(path: Path, rows: Sequence[str]) -> Path:
    path.write_text("\n".join(rows) + "\n")
    return path
