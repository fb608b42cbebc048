"""A scene as flat arrays: one link per joint, one row per degree of freedom and per contact point."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from samrl_core.common.errors import InputError
from samrl_core.model.physics.scene import WORLD, JointKind, PhysicsScene
from samrl_core.model.physics.shapes import SHAPE_FLOATS

COORDINATES = {JointKind.WELD: 0, JointKind.REVOLUTE: 1, JointKind.PRISMATIC: 1, JointKind.FREE: 7}
VELOCITIES = {JointKind.WELD: 0, JointKind.REVOLUTE: 1, JointKind.PRISMATIC: 1, JointKind.FREE: 6}


@dataclass(frozen=True, eq=False)
class Layout:
    """L links, D velocities, C contact points, S solids. A link index of -1 is the world."""

    parent: np.ndarray  # (L,) link
    kind: np.ndarray  # (L,) JointKind
    offset: np.ndarray  # (L, 3) joint in the parent link [m]
    turn: np.ndarray  # (L, 3, 3) joint frame in the parent link
    axis: np.ndarray  # (L, 3)
    first_q: np.ndarray  # (L,)
    first_v: np.ndarray  # (L,)
    body: np.ndarray  # (L,) body that is this link, -1 between two joints of a body
    link_of_body: np.ndarray  # (N,)
    link_of_v: np.ndarray  # (D,)
    before: np.ndarray  # (D,) the velocity before it on the way to the world, -1 at its end
    solved: np.ndarray  # (D,) index among the velocities that are solved for, -1 if driven
    action: np.ndarray  # (D,) index in the action, -1 if not driven
    stiffness: np.ndarray  # (D,)
    damping: np.ndarray  # (D,)
    rest: np.ndarray  # (D,)
    q_of_v: np.ndarray  # (D,) coordinate of a one-dimensional joint, -1 for a free one
    start_q: np.ndarray  # (Q,) joints at zero, free bodies at the origin
    free_quaternion: np.ndarray  # first coordinate of every quaternion
    pair: np.ndarray  # (C,)
    point_link: np.ndarray  # (C,)
    point: np.ndarray  # (C, 3) [m]
    radius: np.ndarray  # (C,) [m]
    solid_link: np.ndarray  # (C,)
    solid: np.ndarray  # (C,)
    solid_kind: np.ndarray  # (S,)
    solid_turn: np.ndarray  # (S, 3, 3) in its link
    solid_offset: np.ndarray  # (S, 3) [m]
    solid_numbers: np.ndarray  # (S, SHAPE_FLOATS) [m]

    @property
    def actions(self) -> int:
        """Number of driven velocities."""
        return int((self.action >= 0).sum())

    @property
    def unknowns(self) -> int:
        """Number of velocities that are solved for."""
        return int((self.solved >= 0).sum())


def lay_out(scene: PhysicsScene) -> Layout:
    """Flattens a scene.

    Raises:
        InputError: every joint is driven, so that nothing is left to solve.
    """
    links: dict[str, list] = {
        k: [] for k in ("parent", "kind", "offset", "turn", "axis", "first_q", "first_v", "body")
    }
    dofs: dict[str, list] = {k: [] for k in ("link", "driven", "stiffness", "damping", "rest", "q")}
    start: list[float] = []
    quaternions: list[int] = []
    link_of_body: list[int] = []
    for index, body in enumerate(scene.bodies):
        previous = WORLD if body.parent == WORLD else link_of_body[body.parent]
        for order, joint in enumerate(body.joints):
            link = len(links["parent"])
            last = order == len(body.joints) - 1
            values = (
                previous,
                int(joint.kind),
                joint.joint_in_parent.position,
                joint.joint_in_parent.rotation,
            )
            more = (joint.axis, len(start), len(dofs["link"]), index if last else -1)
            for key, value in zip(links, (*values, *more), strict=True):
                links[key].append(value)
            count = VELOCITIES[joint.kind]
            dofs["link"] += [link] * count
            dofs["driven"] += [joint.driven] * count
            dofs["damping"] += [joint.damping] * count
            dofs["stiffness"] += [joint.stiffness] * count
            dofs["rest"] += [joint.rest] * count
            if joint.kind == JointKind.FREE:
                quaternions.append(len(start) + 3)
                dofs["q"] += [-1] * 6
                start += [0.0] * 6 + [1.0]
            elif count:
                dofs["q"].append(len(start))
                start.append(0.0)
            previous = link
        link_of_body.append(previous)
    driven = np.array(dofs["driven"], dtype=bool)
    if driven.all():
        raise InputError("every joint is driven or welded; at least one must be left to move by itself")
    return Layout(
        parent=np.array(links["parent"], dtype=np.int32),
        kind=np.array(links["kind"], dtype=np.int32),
        offset=np.array(links["offset"]),
        turn=np.array(links["turn"]),
        axis=np.array(links["axis"], dtype=np.float64),
        first_q=np.array(links["first_q"], dtype=np.int32),
        first_v=np.array(links["first_v"], dtype=np.int32),
        body=np.array(links["body"], dtype=np.int32),
        link_of_body=np.array(link_of_body, dtype=np.int32),
        link_of_v=np.array(dofs["link"], dtype=np.int32),
        before=_before(dofs["link"], links["parent"]),
        solved=np.where(driven, -1, np.cumsum(~driven) - 1).astype(np.int32),
        action=np.where(driven, np.cumsum(driven) - 1, -1).astype(np.int32),
        stiffness=np.array(dofs["stiffness"]),
        damping=np.array(dofs["damping"]),
        rest=np.array(dofs["rest"]),
        q_of_v=np.array(dofs["q"], dtype=np.int32),
        start_q=np.array(start),
        free_quaternion=np.array(quaternions, dtype=np.int64),
        **_contacts(scene, link_of_body),
    )


def _before(link_of_v: list[int], parent: list[int]) -> np.ndarray:
    last = {link: order for order, link in enumerate(link_of_v)}
    result = []
    for order, link in enumerate(link_of_v):
        if order > 0 and link_of_v[order - 1] == link:
            result.append(order - 1)
            continue
        up = parent[link]
        while up != WORLD and up not in last:
            up = parent[up]
        result.append(last.get(up, -1))
    return np.array(result, dtype=np.int32)


def _contacts(scene: PhysicsScene, link_of_body: list[int]) -> dict[str, np.ndarray]:
    shapes = list(scene.world_shapes)
    first = {WORLD: 0}
    for index, body in enumerate(scene.bodies):
        first[index] = len(shapes)
        shapes += body.shapes
    pair, point_link, solid_link, solid = [], [], [], []
    points = [np.zeros((0, 3))]
    radius: list[float] = []
    for index, contact in enumerate(scene.contacts):
        count = len(contact.points)
        pair += [index] * count
        point_link += [link_of_body[contact.point_body]] * count
        solid_link += [WORLD if contact.solid_body == WORLD else link_of_body[contact.solid_body]] * count
        solid += [first[contact.solid_body] + contact.solid] * count
        radius += [contact.point_radius] * count
        points.append(np.asarray(contact.points, dtype=np.float64))
    return {
        "pair": np.array(pair, dtype=np.int32),
        "point_link": np.array(point_link, dtype=np.int32),
        "point": np.concatenate(points),
        "radius": np.array(radius, dtype=np.float64),
        "solid_link": np.array(solid_link, dtype=np.int32),
        "solid": np.array(solid, dtype=np.int32),
        "solid_kind": np.array([int(s.kind) for s in shapes], dtype=np.int32),
        "solid_turn": np.array([s.shape_in_body.rotation for s in shapes]).reshape(-1, 3, 3),
        "solid_offset": np.array([s.shape_in_body.position for s in shapes]).reshape(-1, 3),
        "solid_numbers": np.array([s.numbers for s in shapes]).reshape(-1, SHAPE_FLOATS),
    }
