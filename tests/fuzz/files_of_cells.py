"""Calibrations, drivers, models and meshes of a user's cell, and files that say how something is run."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import trimesh
import yaml

from samrl_core.cell.calibration.calibrate import calibrate, calibrated_cell, write_calibration
from samrl_core.cell.calibration.cell_correction import read_correction as read_cell_correction
from samrl_core.cell.robots.cells import cell_named
from samrl_core.cell.types.pose import Pose
from samrl_core.cell.world.evaluation import read_truth
from samrl_core.common.array_file import write_arrays
from samrl_core.diagnosis.export.correction import ARRAY_FILE, JSON_FILE, read_correction
from samrl_core.diagnosis.nominal_model.read_model import read_model
from samrl_core.model.scene.mesh_file import load_mesh
from samrl_core.studies.model.scan_views import read_views
from samrl_ros.cli.cell.replay import recorded_settings
from samrl_ros.cli.diagnosis.many import ROBOT_FILE, robot_options
from samrl_ros.conversions import from_message
from samrl_ros.hardware.driver_file import FOLDER, DriverFile
from samrl_ros.log_import.formats.parquet import episodes
from samrl_ros.log_import.specs import CsvOptions
from samrl_ros.log_import.tables import read_table
from tests.cell.calibration.test_chain_of_poses import made_pairs
from tests.fuzz.reader import Reader, text_reader

XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="n" default="2"/>
<xacro:property name="m" value="${0.5 * 2}"/><xacro:macro name="link" params="name mass:=1">
<link name="${name}"><inertial><origin xyz="0 0 0.1"/><mass value="${mass}"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></xacro:macro>
<link name="a"/><xacro:link name="b" mass="${m}"/><xacro:if value="$(arg n)"><joint name="j" type="revolute">
<parent link="a"/><child link="b"/><axis xyz="0 0 1"/><limit lower="-2" upper="2" effort="9" velocity="3"/>
</joint></xacro:if></robot>"""
MJCF = """<mujoco model="m"><compiler angle="radian"/><option timestep="0.002" gravity="0 0 -9.81"/>
<worldbody><body name="b" pos="0 0 1"><inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/>
<joint name="j" axis="0 0 1" range="-2 2" damping="0.1" frictionloss="0.2" armature="0.01"/>
<body name="c" pos="0 0 0.2"><joint name="k" type="slide" axis="1 0 0"/><geom size="0.05" mass="0.3"/></body>
</body></worldbody><actuator>
<position joint="j" kp="100" kv="5" forcerange="-9 9"/><motor joint="k"/></actuator>
</mujoco>"""


def _pose_entry(pose: Pose) -> dict[str, list[float]]:
    return {
        "position": np.round(pose.position, 6).tolist(),
        "quat_xyzw": np.round(pose.quat_xyzw, 9).tolist(),
    }


def _hand_eye_pairs() -> bytes:
    made = made_pairs(8, 1, noise=0.0)
    pairs = [
        {"flange_in_base": _pose_entry(flange), "board_in_camera": _pose_entry(seen.inverse())}
        for flange, seen in zip(made.moving, made.measured, strict=True)
    ]
    return json.dumps({"kind": "hand_eye", "pairs": pairs}).encode()


def _base_pairs() -> bytes:
    made = made_pairs(6, 2, noise=0.0)
    pairs = [
        {
            "tool_flange_in_base": _pose_entry(flange),
            "camera_flange_in_base": _pose_entry(flange),
            "board_in_camera": _pose_entry(seen),
        }
        for flange, seen in zip(made.moving, made.measured, strict=True)
    ]
    return json.dumps({"kind": "base_to_base", "pairs": pairs}).encode()


@cache
def _hand_eye() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        pairs, out = Path(folder) / "pairs.json", Path(folder)
        pairs.write_bytes(_hand_eye_pairs())
        write_calibration(calibrate(pairs, None), pairs, out)
        return (out / "calibration.json").read_bytes()


def _calibrate(path: Path) -> None:
    beside = path.with_name("hand_eye.json")
    beside.write_bytes(_hand_eye())
    calibrate(path, beside if b"base_to_base" in path.read_bytes() else None)


def _drivers() -> list[bytes]:
    return [path.read_bytes() for path in sorted(FOLDER.glob("*.yaml"))]


def _mesh(format: str) -> Callable[[], list[bytes]]:
    def write() -> list[bytes]:
        made: Any = trimesh.creation.box((0.05, 0.06, 0.07)).export(file_type=format)
        return [made.encode() if isinstance(made, str) else bytes(made)]

    return write


def _correction() -> bytes:
    law = {
        "stiffness": [100.0], "damping": [5.0], "effort_limit": ["inf"], "period_s": 0.001,
        "gravity_compensation": True, "gravity": [0.0, 0.0, -9.81],
    }  # fmt: skip
    about = {
        "schema": 1, "effects": ["coulomb_friction@j"], "joints": ["j"], "unsimulated": [],
        "fields": {"coulomb": [0.4]}, "nominal": {k: [0.1] for k in ("friction", "damping", "armature")},
        "law": law, "tool": {"mass": 1.0, "center_of_mass": [0, 0, 0.1], "inertia": [1, 0, 0, 1, 0, 1]},
        "promise": {"shrink": 0.5, "ci95": [0.4, 0.6]}, "model": {}, "urdf": "<robot/>", "recordings": 1,
    }  # fmt: skip
    return json.dumps(about).encode()


def _cell_correction() -> bytes:
    pose = {"position": [0.0, 0.01, 0.05], "quat_xyzw": [0.0, 0.0, 0.0, 1.0]}
    of, matrix = ["camera_in_flange.x", "fx"], [[1e-6, 1e-6], [1e-6, 4e-6]]
    about = {
        "schema": 1, "kind": "cell_correction", "effects": ["hand_eye@sensor:camera"],
        "camera_in_flange": pose, "numbers": {"fx": 0.02}, "covariance": {"of": of, "matrix": matrix},
    }  # fmt: skip
    return json.dumps(about).encode()


def _write_correction_arrays(path: Path) -> None:
    arrays = {
        "sample.coulomb": np.ones((4, 1)),
        "motion.time": np.arange(5.0),
        "held_out.0.time": np.arange(5.0),
    }
    write_arrays(path.parent / ARRAY_FILE, arrays)


def _views() -> bytes:
    flat = {
        "color": np.zeros((2, 2, 3, 3)), "depth": np.ones((2, 2, 3)), "mask": np.ones((2, 2, 3)),
        "intrinsics": np.array([4.0, 4.0, 1.5, 1.0]), "camera_in_world": np.tile(np.eye(4), (2, 1, 1)),
    }  # fmt: skip
    types = {"color": "uint8", "mask": "bool"}
    return json.dumps({k: [types.get(k, "float"), v.tolist()] for k, v in flat.items()}).encode()


def _read_views(path: Path) -> None:
    file = path.with_name("views.npz")
    try:
        content = dict(json.loads(path.read_bytes()))
        write_arrays(file, {name: np.array(v, dtype=d) for name, (d, v) in content.items()})
    except (ValueError, KeyError, TypeError, RecursionError, OverflowError, OSError):
        return  # no archive that anybody could have written
    read_views(file)


def _write_episode(path: Path) -> None:
    data = path.parents[1] / "data" / "chunk-000"
    data.mkdir(parents=True)
    path.parent.mkdir()
    state = {"timestamp": [0.0, 0.1], "episode_index": [0, 0], "observation.state": [[0.1, 0.2], [0.2, 0.3]]}
    pq.write_table(pa.table(state), data / "file-000.parquet")


def _read_dataset(path: Path) -> None:
    dataset = path.parents[1]
    episodes(dataset)
    read_table(dataset, CsvOptions(), "it", "0")


def _lerobot() -> bytes:
    state = {"dtype": "float32", "shape": [2], "names": {"motors": ["shoulder", "elbow"]}}
    about = {
        "codebase_version": "v3.0",
        "total_episodes": 1,
        "fps": 30,
        "features": {"observation.state": state},
    }
    return json.dumps(about).encode()


def _truth() -> bytes:
    body = {
        "body_position": {"hole": [0.5, 0, 0]},
        "body_quat_xyzw": {"hole": [0, 0, 0, 1]},
        "body_speed": {},
    }
    lines = [{"episode": k, "event": event, **body} for k in range(2) for event in ("start", "end")]
    return "\n".join(map(json.dumps, lines)).encode()


def _run_parameters() -> bytes:
    values = {
        node: {"ros__parameters": {"task": "peg_insertion"}} for node in ("/cell/policy", "/cell/supervisor")
    }
    return yaml.safe_dump(values).encode()


FILES_OF_CELLS: tuple[Reader, ...] = (
    Reader("pairs of poses", "pairs.json", lambda: [_hand_eye_pairs(), _base_pairs()], _calibrate, share=0.3),
    Reader(
        "hand-eye calibration", "calibration.json", lambda: [_hand_eye()],
        lambda path: calibrated_cell(cell_named(), path, None),
    ),
    Reader("driver", "driver.yaml", _drivers, DriverFile.from_file),
    Reader("xacro", "a.xacro", lambda: [XACRO.encode()], read_model, share=0.3),
    Reader("MJCF", "a.xml", lambda: [MJCF.encode()], read_model),
    *(
        Reader(f"mesh {kind}", f"a.{kind}", _mesh(kind), lambda path: load_mesh(path, 1.0))
        for kind in ("stl", "obj", "ply", "off", "glb")
    ),
    Reader(
        "correction", JSON_FILE, lambda: [_correction()], lambda path: read_correction(path.parent),
        prepare=_write_correction_arrays,
    ),
    Reader("correction of a cell", "cell.json", lambda: [_cell_correction()], read_cell_correction),
    Reader("views of a scan", "views.json", lambda: [_views()], _read_views),
    Reader(
        "LeRobot dataset", "log/meta/info.json", lambda: [_lerobot()], _read_dataset, share=0.3,
        prepare=_write_episode,
    ),
    Reader("truth", "truth.jsonl", lambda: [_truth()], read_truth),
    Reader(
        "options of a robot", ROBOT_FILE, lambda: [b"urdf: a.urdf\narm: tool_arm\nxacro_arg: [a:=1, b:=2]\n"],
        lambda path: robot_options(path.parent),
    ),
    Reader(
        "parameters of a run", "params.yaml", lambda: [_run_parameters()],
        lambda path: recorded_settings(path.parent / "bag.mcap"),
    ),
    Reader(
        "operator's request", "r", lambda: [b'{"asks": "scene", "episode": 1, "text": "lay it"}'],
        text_reader(from_message.operator_question),
    ),
    Reader(
        "operator's judgement", "j", lambda: [b'{"episode": 1, "success": true}'],
        text_reader(from_message.operator_judgement),
    ),
)  # fmt: skip
