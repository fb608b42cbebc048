"""Shown to viewers besides recorded messages: differences, clouds, views, meshes, live and from bags."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from samrl_core.common.errors import InputError
from samrl_ros.bags.reader import open_bag
from samrl_ros.contract.topics import cell_topic
from tests.ros.bag_files import record

pytest.importorskip("rclpy")
pytestmark = pytest.mark.ros

TOOL_ARM = "/cell/tool_arm/robot_description"
CANDIDATES, TARGET = cell_topic("view_planner/candidates"), cell_topic("view_planner/target")


def shown_of(messages: list[tuple[int, str, Any]], **arguments: Any) -> dict[str, list[Any]]:
    """What viewers are shown of messages, by topic."""
    from rclpy.serialization import deserialize_message, serialize_message

    from samrl_ros.cell.viewer.viewer_messages import TAKEN, ViewerMessages
    from samrl_ros.contract.message_types import message_class

    made = ViewerMessages("peg_insertion", "panda_rizon", **arguments)
    found: dict[str, list[Any]] = {}
    for _, topic, message in messages:
        for shown in made.take(topic, serialize_message(message)) if topic in TAKEN else ():
            found.setdefault(shown.topic, []).append(
                deserialize_message(shown.data, message_class(shown.type))
            )
    return found


def points_of(cloud: Any) -> np.ndarray:
    """Rows of a PointCloud2 of float32 fields, (N, F)."""
    return np.frombuffer(bytes(cloud.data), np.float32).reshape(cloud.width, len(cloud.fields))


@pytest.fixture(scope="module")
def shown(three_actions: Any) -> dict[str, list[Any]]:
    return shown_of(three_actions.messages)


def test_the_difference_comes_with_the_model_image_of_the_same_instant() -> None:
    from samrl_ros.cell.report.pictures import COLOR, MODEL
    from samrl_ros.cell.viewer.viewer_messages import DIFFERENCE
    from samrl_ros.conversions.from_message import image, stamp_ns
    from tests.ros.run.small_run import picture, stamped

    camera = [(k, COLOR, stamped(picture(k), k + 1)) for k in range(100)]
    gone, there = stamped(picture(60), 7), stamped(picture(60), 91)
    (message,) = shown_of([*camera, (0, MODEL, gone), (0, MODEL, there)])[DIFFERENCE]
    assert stamp_ns(message) == 91
    assert np.array_equal(image(message), np.full((12, 16, 3), 60))  # twice |90 - 60|


def test_clouds_of_camera_and_model_are_of_one_scene(shown: dict[str, list[Any]]) -> None:
    from samrl_ros.cell.viewer.viewer_messages import CAMERA_CLOUD, MODEL_CLOUD
    from samrl_ros.conversions.from_message import stamp_ns

    model = shown[MODEL_CLOUD][-1]
    camera = min(shown[CAMERA_CLOUD], key=lambda c: abs(stamp_ns(c) - stamp_ns(model)))
    assert model.header.frame_id == camera.header.frame_id == "camera_color_optical_frame"
    seen, drawn = points_of(camera)[:, :3], points_of(model)[:, :3]
    assert min(len(seen), len(drawn)) > 500 and np.isfinite(drawn).all()
    distance, _ = KDTree(seen).query(drawn)
    assert np.median(distance) < 0.004


def test_a_cloud_lies_where_its_pixels_look() -> None:
    from samrl_core.cell.types.camera import Intrinsics
    from samrl_ros.cell.viewer.clouds import depth_points

    depth = np.full((4, 6), np.nan, np.float32)
    depth[2, 4] = 0.5
    colors = np.zeros((4, 6, 3), np.uint8)
    colors[2, 4] = (10, 20, 30)
    ((x, y, z, rgb),) = depth_points(depth, colors, Intrinsics(6, 4, 10.0, 20.0, 3.0, 2.0))
    assert (x, y, z) == pytest.approx((0.5 * 1.5 / 10.0, 0.5 * 0.5 / 20.0, 0.5))
    assert np.float32(rgb).tobytes() == bytes([30, 20, 10, 0])


def test_clouds_are_made_for_those_who_look(three_actions: Any) -> None:
    from samrl_ros.cell.viewer.viewer_messages import CAMERA_CLOUD, DIFFERENCE, MODEL_CLOUD

    found = shown_of(three_actions.messages, wanted=lambda topic: False)
    assert DIFFERENCE in found and not {CAMERA_CLOUD, MODEL_CLOUD} & set(found)


def test_every_view_that_was_scored_is_told(three_actions: Any) -> None:
    (target,), (cloud,) = three_actions.on(TARGET), three_actions.on(CANDIDATES)
    assert cloud.width == target.candidates > 1 and cloud.header == target.header
    assert [field.name for field in cloud.fields] == ["x", "y", "z", "score"]
    p, points = target.camera_in_world.position, points_of(cloud)
    chosen = np.linalg.norm(points[:, :3] - [p.x, p.y, p.z], axis=1).argmin()
    if target.move:
        assert points[chosen] == pytest.approx([p.x, p.y, p.z, target.score], abs=1e-5)


def test_the_chosen_view_is_marked_with_its_score(shown: dict[str, list[Any]], three_actions: Any) -> None:
    from samrl_ros.cell.viewer.viewer_messages import VIEW

    ((arrow, text),) = (array.markers for array in shown[VIEW])
    (target,) = three_actions.on(TARGET)
    assert f"{target.score:.3f}" in text.text and f"{target.present_score:.3f}" in text.text
    assert text.text.startswith("move" if target.move else "stay")
    start, end = (np.array([p.x, p.y, p.z]) for p in arrow.points)
    p = target.camera_in_world.position
    assert start == pytest.approx([p.x, p.y, p.z])
    assert (end - start) @ (np.array([0.5, 0.0, 0.03]) - start) > 0  # towards the scene


def test_of_links_with_an_installed_mesh_the_mesh_is_shown(three_actions: Any) -> None:
    import xml.etree.ElementTree as ElementTree

    from samrl_ros.cell.viewer.meshes import asset, by_value

    shown = shown_of(three_actions.messages, mesh_url=by_value)
    (published,) = three_actions.on(TOOL_ARM)
    urdf = ElementTree.fromstring(shown[TOOL_ARM][0].data)
    meshes = urdf.findall("link/visual/geometry/mesh")
    assert len(meshes) == 8 and "<mesh" not in published.data
    for mesh in meshes:
        kind, data = mesh.attrib["filename"].split(",")
        assert kind == "data:model/gltf-binary;base64" and base64.b64decode(data)[:4] == b"glTF"
    (camera_arm,) = shown["/cell/camera_arm/robot_description"]
    assert camera_arm.data == three_actions.on("/cell/camera_arm/robot_description")[0].data  # none there
    assert asset("package://franka_panda/meshes/visual/link1.obj") is not None
    assert asset("package://franka_panda/meshes/visual/link99.obj") is None


def test_a_mesh_keeps_its_place_as_gltf() -> None:
    import io

    import trimesh

    from samrl_ros.cell.viewer.meshes import as_glb, package_file

    file = package_file("package://franka_panda/meshes/visual/link1.obj")
    assert file is not None
    before = trimesh.load_scene(str(file)).bounds
    after = trimesh.load_scene(io.BytesIO(as_glb(file)), file_type="glb").bounds
    y_up = np.sort(np.array([[x, z, -y] for x, y, z in before]), axis=0)
    assert after == pytest.approx(y_up, abs=1e-5)


@pytest.mark.parametrize(
    "uri",
    [
        "package://franka_panda/../../../etc/passwd",
        "package://franka_panda/LICENSE.txt",
        "package://../franka_panda/meshes/visual/link1.obj",
        "package:///etc/passwd",
        "package://franka_panda",
        "file:///etc/passwd",
        "/etc/passwd",
        "package://franka_panda/meshes/visual/link1.obj/../../../LICENSE.txt.glb",
    ],
)
def test_nothing_but_meshes_of_a_package_is_served(uri: str) -> None:
    from samrl_ros.cell.viewer.meshes import asset

    assert asset(uri) is None


def test_a_mesh_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    from samrl_ros.cell.viewer.meshes import as_glb

    (tmp_path / "link.obj").write_bytes(b"\x00\xff no mesh")
    with pytest.raises(InputError, match="no mesh that can be read"):
        as_glb(tmp_path / "link.obj")


@pytest.mark.thorough
def test_a_bag_is_copied_with_what_viewers_are_shown(three_actions: Any, tmp_path: Path) -> None:
    from samrl_ros.cell.viewer.view_file import write_view
    from samrl_ros.cell.viewer.viewer_messages import MADE

    bag = record(tmp_path / "bag", three_actions.messages, {"task": "peg_insertion"})
    added = write_view(bag, tmp_path / "view")
    source, copy = open_bag(bag), open_bag(tmp_path / "view")
    counts = {topic.name: topic.count for topic in copy.topics}
    assert all(counts[topic] for topic in MADE) and sum(counts[topic] for topic in MADE) == added
    assert {t.name: t.count for t in source.topics} == {n: c for n, c in counts.items() if n not in MADE}
    for raw, message in copy.decoded(MADE):
        assert message is not None, raw.topic
    ((_, robot),) = copy.decoded((TOOL_ARM,))
    assert robot.data.count("data:model/gltf-binary") == 8
    with pytest.raises(InputError, match="lies inside the bag"):
        write_view(bag, bag / "view")


def test_a_bag_of_another_cell_is_left_alone(three_actions: Any, tmp_path: Path) -> None:
    from samrl_ros.cell.viewer.view_file import write_view

    bag = record(tmp_path / "bag", three_actions.messages[:100])
    with pytest.raises(InputError, match="does not tell its task"):
        write_view(bag, tmp_path / "view")
    assert not (tmp_path / "view").exists()


def test_a_later_topic_leaves_the_digest_of_older_bags(three_actions: Any) -> None:
    from samrl_ros.cell.replay import RecordingOutbox, _report

    def digest(said: set[str], present: dict[str, Any]) -> str:
        outbox = RecordingOutbox()
        for topic in said:
            outbox.publish(topic, three_actions.on(topic)[0])
        return _report("", 0, {}, {"view_planner": outbox}, present, said, {}, False).digest

    info = {t.name: t for t in ()}
    assert digest({TARGET, CANDIDATES}, info) == digest({TARGET}, info)
