"""Logs as eight labs write them, one physical effect in each, made with NumPy and SciPy alone.

python -m tests.recordings.logs.eight_labs DIR makes a folder for each.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

G = 9.81
LATE_S, PLAY_DEG, DRY_NM, VISCOUS = 0.048, 1.2, 0.012, 0.012
TILT_DEG, IMAGES_LATE_S, TOO_FAR, FRICTION = 2.5, 0.06, 1.015, 0.22
MOTOR = {"resistance": 1.2, "torque_constant": 0.052, "inertia": 2.4e-4, "viscous": 1.0e-4, "counts": 2000}
ROD = {"mass": 0.5, "length": 0.6}
Y_UP = Rotation.from_matrix([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


def waves(time: np.ndarray, count: int, size: float, rng: np.random.Generator, fastest: float) -> np.ndarray:
    """Sums of sines (N, count) that begin at zero."""
    out = np.zeros((len(time), count))
    for column in out.T:
        for _ in range(5):
            rate, phase = rng.uniform(0.08, fastest), rng.uniform(0.0, 2 * np.pi)
            column += size / 5 * rng.uniform(0.6, 1.4) * np.sin(2 * np.pi * rate * time + phase)
    return out - out[0]


def write(path: Path, names: list[str], rows: np.ndarray, parted: str = ",", form: str = "%.6f") -> None:
    np.savetxt(path, rows, delimiter=parted, header=parted.join(names), comments="", fmt=form)


def ur_rtde(folder: Path) -> None:
    """Universal Robots' RTDE recorder: blanks, numbered columns, 125 Hz; the arm follows late."""
    rng = np.random.default_rng(1)
    for run in (1, 2):
        time, fine = np.arange(0.0, 20.0, 0.008), np.arange(-1.0, 21.0, 0.001)
        path = waves(fine, 6, 0.5, rng, 0.6) + [0.2, -1.4, 1.6, -1.8, -1.57, 0.3]
        target, actual = (
            np.column_stack([np.interp(time - late, fine, column) for column in path.T])
            for late in (0.0, LATE_S)
        )
        actual = actual + 2e-5 * rng.standard_normal(actual.shape)
        speed = np.gradient(actual, time, axis=0) + 1e-3 * rng.standard_normal(actual.shape)
        current = 0.8 * np.gradient(speed, time, axis=0)
        kinds = ("target_q", "actual_q", "actual_qd", "actual_current")
        names = ["timestamp", *[f"{kind}_{k}" for kind in kinds for k in range(6)], "robot_mode"]
        mode = np.full(len(time), 7)
        rows = np.column_stack([4500.128 + time, target, actual, speed, current, mode])
        write(folder / f"move{run}.csv", names, rows, " ")


def dynamixel(folder: Path) -> None:
    """Two servos read by a script: ticks of 4096 a turn, mA, ms; the second has play behind its gear."""
    rng, play = np.random.default_rng(2), np.radians([0.0, PLAY_DEG])
    for name, size, fastest in (("slow", 1.2, 0.4), ("fast", 1.6, 0.7)):
        step = 0.002
        time = np.arange(0.0, 24.0, step)
        goal = waves(time, 2, size, rng, fastest)
        motor, speed, link, rows = np.zeros(2), np.zeros(2), np.zeros(2), []
        for k, now in enumerate(time):
            acceleration = 1600.0 * (goal[k] - motor) - 60.0 * speed
            speed = speed + acceleration * step
            motor = motor + speed * step
            link = np.clip(link, motor - play / 2, motor + play / 2)
            if k % 5 == 0:
                ticks = 2048 + np.stack([goal[k], link + 3e-4 * rng.standard_normal(2)]) * 4096 / (2 * np.pi)
                amperes = 15.0 * acceleration + 4.0 * rng.standard_normal(2)
                rows.append([1e3 * now, *np.stack([*np.round(ticks), amperes]).T.ravel()])
        kinds = ("goal_position", "present_position", "present_current_mA")
        names = ["time_ms", *[f"id{k}_{kind}" for k in (1, 2) for kind in kinds]]
        write(folder / f"{name}.csv", names, np.array(rows), form="%.0f")


def dc_motor(folder: Path) -> None:
    """A bench in German: lines above, semicolons, decimal commas, volts, counts; the bearing is dry."""
    rng, m = np.random.default_rng(3), MOTOR
    for run in (1, 2):
        time = np.arange(0.0, 20.0, 0.002)
        volts = 4.0 * waves(time, 1, 1.5, rng, 1.2)[:, 0] + 3.0 * np.sign(np.sin(np.pi * time / 2))
        angle, speed, counts = 0.0, 0.0, []
        for volt in volts:
            for _ in range(4):
                torque = m["torque_constant"] * (volt - m["torque_constant"] * speed) / m["resistance"]
                torque -= m["viscous"] * speed
                if abs(speed) < 1e-3 and abs(torque) < DRY_NM:
                    speed = 0.0
                else:
                    way = speed if abs(speed) > 1e-6 else torque
                    speed += 0.0005 * (torque - DRY_NM * np.sign(way)) / m["inertia"]
                angle += 0.0005 * speed
            counts.append(round(angle * m["counts"] / (2 * np.pi)))
        rows = [f"{t:.3f};{u:.4f};{c}" for t, u, c in zip(time, volts, counts, strict=True)]
        text = "Pruefstand 4\nMotor M2\nZeit [s];Spannung U [V];Encoder\n" + "\n".join(rows).replace(".", ",")
        (folder / f"lauf{run}.csv").write_text(text + "\n")
    inertia = 'ixx="{0}" ixy="0" ixz="0" iyy="{0}" iyz="0" izz="{0}"'.format(m["inertia"])
    _write_urdf(folder / "motor.urdf", "shaft", f'<mass value="0.1"/><inertia {inertia}/>', "0 0 1")


def pendulum(folder: Path) -> None:
    """A rod that was let go, its angle in degrees from a potentiometer; the bearing is viscous."""
    rng, mass, length = np.random.default_rng(4), ROD["mass"], ROD["length"]

    def rate(_: float, y: np.ndarray) -> list[float]:
        return [y[1], (-0.5 * mass * G * length * np.sin(y[0]) - VISCOUS * y[1]) / (mass * length**2 / 3)]

    for run, start in ((1, 70.0), (2, -55.0)):
        time = np.arange(0.0, 15.0, 0.01)
        swing = solve_ivp(rate, (0.0, 15.0), [np.radians(start), 0.0], t_eval=time, rtol=1e-9, atol=1e-10).y
        angle = np.degrees(swing[0]) + 0.05 * rng.standard_normal(len(time))
        write(folder / f"swing{run}.csv", ["time", "angle_deg"], np.column_stack([time, angle]), form="%.3f")
    about = mass * length**2 / 12
    inertia = f'ixx="{about}" ixy="0" ixz="0" iyy="{about}" iyz="0" izz="1e-5"'
    body = f'<origin xyz="0 0 {-length / 2}"/><mass value="{mass}"/><inertia {inertia}/>'
    _write_urdf(folder / "pendulum.urdf", "pivot", body, "0 1 0")


def optitrack(folder: Path) -> None:
    """Tosses of a box by Motive: y up, mm, a still stand, lost frames; the ground plane leans."""
    rng, tilt = np.random.default_rng(5), Rotation.from_euler("x", TILT_DEG, degrees=True)
    moments = np.array([0.0012, 0.0018, 0.0022])

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        q, w = y[:4], y[4:]
        turn = 0.5 * np.concatenate([q[3] * w + np.cross(q[:3], w), [-q[:3] @ w]])
        return np.concatenate([turn, np.cross(moments * w, w) / moments])

    for run in range(6):
        time = np.arange(0.0, 0.7, 1 / 180)
        begin = rng.uniform(-0.3, 0.3, 3) + [0.0, 0.0, 1.0]
        speed = np.array([*rng.uniform(-1.5, 1.5, 2), rng.uniform(2.0, 3.0)])
        path = begin + speed * time[:, None] + 0.5 * np.array([0.0, 0.0, -G]) * time[:, None] ** 2
        first = [0.0, 0.0, 0.0, 1.0, *rng.uniform(-6.0, 6.0, 3)]
        turn = Rotation.from_quat(solve_ivp(rate, (0.0, 0.7), first, t_eval=time, rtol=1e-9).y[:4].T)
        shaken = Rotation.from_rotvec(4e-3 * rng.standard_normal(path.shape))
        seen = 1e3 * Y_UP.apply(tilt.apply(path)) + 0.3 * rng.standard_normal(path.shape)
        quats = (Y_UP * shaken * tilt * turn).as_quat()
        rows = [
            f"Format Version,1.23,Take Name,Toss {run},Capture Frame Rate,180.000000,"
            "Rotation Type,Quaternion,Length Units,Millimeters,Coordinate Space,Global",
            "",
            ",," + ",".join(["Rigid Body"] * 16),
            ",," + ",".join(["Stand"] * 8 + ["Box"] * 8),
            ",," + ",".join(["1"] * 8 + ["2"] * 8),
            ",," + ",".join((["Rotation"] * 4 + ["Position"] * 3 + ["Mean Marker Error"]) * 2),
            "Frame,Time (Seconds)," + ",".join([*"XYZWXYZ", ""] * 2),
        ]
        for k, now in enumerate(time):
            still = ["0", "0", "0", "1", "100.1", "20.0", "-33.0", "0.2"]
            body = [f"{v:.6f}" for v in (*quats[k], *seen[k], 0.2)]
            lost = rng.uniform() < 0.03
            rows.append(",".join([str(k), f"{now:.6f}", *still, *([""] * 8 if lost else body)]))
        (folder / f"Toss {run}.csv").write_text("\n".join(rows) + "\n")


def apriltag(folder: Path) -> None:
    """A wrist camera before a tag: flange at 250 Hz in mm and degrees, tag at 30 Hz; images are late."""
    rng = np.random.default_rng(6)
    time = np.arange(0.0, 40.0, 0.004)
    place = np.array([0.45, 0.0, 0.5]) + waves(time, 3, 0.25, rng, 0.5)
    turn = Rotation.from_euler("xyz", [np.pi, 0.0, 0.3]) * Rotation.from_rotvec(waves(time, 3, 0.8, rng, 0.5))
    angles = turn.as_euler("xyz", degrees=True)
    names = ["t", *[f"tcp_{a}_mm" for a in "xyz"], *[f"tcp_{a}_deg" for a in ("roll", "pitch", "yaw")]]
    write(folder / "robot_tcp.csv", names, np.column_stack([time, 1e3 * place, angles]))
    stamps = np.arange(1.0, 39.0, 1 / 30)
    then = np.searchsorted(time, stamps - IMAGES_LATE_S)
    camera = turn[then] * Rotation.from_euler("z", 90, degrees=True)
    eye = place[then] + turn[then].apply([0.05, 0.01, 0.06])
    target = np.array([0.5, 0.05, 0.0])
    seen = camera.inv().apply(target - eye) + 4e-4 * rng.standard_normal((len(stamps), 3))
    noise = Rotation.from_rotvec(2e-3 * rng.standard_normal((len(stamps), 3)))
    quats = (camera.inv() * Rotation.from_euler("xyz", [0.02, -0.01, 0.4]) * noise).as_quat()
    names = ["t", *[f"tag_{a}" for a in "xyz"], *[f"tag_q{a}" for a in "xyzw"]]
    write(folder / "tag_in_camera.csv", names, np.column_stack([stamps, seen, quats]))


def depth_wall(folder: Path) -> None:
    """A depth camera before a wall at distances of a laser; it measures too far."""
    rng = np.random.default_rng(7)
    true = np.repeat([0.5, 0.8, 1.1, 1.4, 1.8, 2.2], 60)
    depth = TOO_FAR * true + 0.0012 * true**2 * rng.standard_normal(len(true))
    rows = np.column_stack([np.arange(len(true)), 1e3 * depth, 1e3 * true])
    write(folder / "wall.csv", ["frame", "depth_mm", "laser_mm"], rows, form="%.2f")


def block(folder: Path) -> None:
    """A block on a table filmed from above at 60 Hz, mm and degrees; it slides farther than stated."""
    rng = np.random.default_rng(8)
    for run in range(6):
        way, speed = rng.uniform(0.0, 2 * np.pi), rng.uniform(0.8, 1.3)
        time, stop = np.arange(0.0, 1.2, 1 / 60), speed / (FRICTION * G)
        path = np.where(time < stop, speed * time - 0.5 * FRICTION * G * time**2, 0.5 * speed * stop)
        seen = rng.uniform(-0.2, 0.2, 2) + path[:, None] * [np.cos(way), np.sin(way)]
        seen = 1e3 * seen + 0.4 * rng.standard_normal(seen.shape)
        angle = 20.0 * run + 0.3 * rng.standard_normal(len(time))
        rows = np.column_stack([np.arange(len(time)), time, seen, angle])
        names = ["frame", "time_s", "block_x_mm", "block_y_mm", "block_angle_deg"]
        write(folder / f"slide_{run}.csv", names, rows, form="%.4f")


def _write_urdf(path: Path, joint: str, inertial: str, axis: str) -> None:
    path.write_text(
        f'<robot name="r"><link name="base"/><link name="body"><inertial>{inertial}</inertial></link>'
        f'<joint name="{joint}" type="continuous"><parent link="base"/><child link="body"/>'
        f'<axis xyz="{axis}"/></joint></robot>'
    )


LABS: dict[str, Callable[[Path], None]] = {
    make.__name__: make
    for make in (ur_rtde, dynamixel, dc_motor, pendulum, optitrack, apriltag, depth_wall, block)
}


def make_lab(name: str, parent: Path) -> Path:
    """The folder of one lab's logs."""
    folder = parent / name
    folder.mkdir(parents=True, exist_ok=True)
    LABS[name](folder)
    return folder


if __name__ == "__main__":
    for each in LABS:
        make_lab(each, Path(sys.argv[1]))
