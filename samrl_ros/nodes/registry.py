"""The nodes by name: settings, behaviour, host. Launch, command line and replay read this list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from samrl_core.common.errors import InputError
from samrl_ros.contract.behaviour import Behaviour, Outbox

# In the order of starting: the recorder first, so that nothing is missed; the supervisor last, when all
# others answer.
NODES = (
    "recorder",
    "sim_bridge",
    "manipulator",
    "view_planner",
    "policy",
    "model_updater",
    "residual_trainer",
    "supervisor",
)
# In the place of the simulated cell, before the drivers of a real one.
BRIDGES = ("sim_bridge", "hardware_bridge")
EXECUTABLES = (*NODES, "hardware_bridge")


def nodes_of_run(hardware: bool, observe_only: bool = False) -> tuple[str, ...]:
    """The nodes of a run, in the order of starting. Where nothing may move, nobody is there to ask for it."""
    if observe_only:
        return ("recorder", "hardware_bridge")
    return tuple("hardware_bridge" if hardware and name == "sim_bridge" else name for name in NODES)


@dataclass(frozen=True)
class NodeEntry:
    """A node that hosts a behaviour."""

    settings: type
    behaviour: Callable[[Any, Outbox], Behaviour]


def behaviour_nodes() -> dict[str, NodeEntry]:
    """Nodes driven by messages alone; imported here because each pulls in its part of the core."""
    from samrl_ros.nodes.manipulator import Manipulator, ManipulatorSettings
    from samrl_ros.nodes.model_updater import ModelUpdater, ModelUpdaterSettings
    from samrl_ros.nodes.policy import PolicyNode, PolicySettings
    from samrl_ros.nodes.residual_trainer import ResidualTrainer, ResidualTrainerSettings
    from samrl_ros.nodes.supervisor import Supervisor, SupervisorSettings
    from samrl_ros.nodes.view_planner import ViewPlannerNode, ViewPlannerSettings

    return {
        "manipulator": NodeEntry(ManipulatorSettings, Manipulator),
        "view_planner": NodeEntry(ViewPlannerSettings, ViewPlannerNode),
        "policy": NodeEntry(PolicySettings, PolicyNode),
        "model_updater": NodeEntry(ModelUpdaterSettings, ModelUpdater),
        "residual_trainer": NodeEntry(ResidualTrainerSettings, ResidualTrainer),
        "supervisor": NodeEntry(SupervisorSettings, Supervisor),
    }


def all_settings() -> dict[str, Any]:
    """Settings types by node."""
    from samrl_ros.nodes.bridge.hardware_bridge import HardwareBridgeSettings
    from samrl_ros.nodes.bridge.sim_bridge import SimBridgeSettings
    from samrl_ros.nodes.recorder_node import RecorderSettings

    settings: dict[str, Any] = {"sim_bridge": SimBridgeSettings}
    settings |= {name: node.settings for name, node in behaviour_nodes().items()}
    settings["recorder"] = RecorderSettings
    settings["hardware_bridge"] = HardwareBridgeSettings
    return settings


def entry(name: str) -> NodeEntry:
    """One behaviour node.

    Raises:
        InputError: no such node.
    """
    nodes = behaviour_nodes()
    if name not in nodes:
        raise InputError(f"no node {name!r} with a behaviour; there are {', '.join(nodes)}")
    return nodes[name]


def make_node(name: str) -> Any:
    """The node on the live graph, a `CellNode`; its parameters come from the arguments ROS was started with.

    Raises:
        InputError: no such node, or a parameter that does not fit.
    """
    if name == "sim_bridge":
        from samrl_ros.nodes.bridge.sim_bridge import SimBridge

        return SimBridge()
    if name == "hardware_bridge":
        from samrl_ros.nodes.bridge.hardware_bridge import HardwareBridge

        return HardwareBridge()
    if name == "recorder":
        from samrl_ros.nodes.recorder_node import RecorderNode

        return RecorderNode()
    from samrl_ros.hosting import BehaviourNode

    found = entry(name)
    return BehaviourNode(found.behaviour, found.settings, name)
