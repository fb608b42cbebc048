"""What a run of the cell is asked to do, checked before anything starts."""

from __future__ import annotations

import importlib.util
import os
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from samrl_core.cell.calibration.calibrate import calibrated_cell
from samrl_core.cell.calibration.cell_correction import read_correction
from samrl_core.cell.instance.cell_instance import NOMINAL, InstanceName
from samrl_core.cell.robots.cells import DEFAULT_CELL, cell_named
from samrl_core.cell.tasks import DEFAULT_TASK, EVERY_TASK, task_named
from samrl_core.cell.world import DEFAULT_WORLD, WORLDS
from samrl_core.common.errors import InputError
from samrl_core.common.files import write_whole
from samrl_core.policy.agent.loop import LoopSettings
from samrl_core.policy.agent.policies import DEFAULT_POLICY, RUN_POLICIES, STRATEGIES, STRATEGY_OF, TOUCH
from samrl_core.policy.contact.surface_touch import felt_surface
from samrl_core.policy.contact.touch_insertion import require_peg
from samrl_ros.cell.parameter_file import load_parameters
from samrl_ros.contract.settings import IMAGES_KEPT, JUDGES, OUTLASTS_STOPS, REAL_TIME_FACTOR
from samrl_ros.hardware.driver_file import PARTS, DriverFile, drivers_by_part
from samrl_ros.nodes.registry import BRIDGES, EXECUTABLES, nodes_of_run

LAYOUTS = ("split", "processes", "threads")
# Options that mean nothing in a simulated and in a real cell.
_REAL = ("observe", "judge", "hand_eye", "bases", "sim_time")
_SIMULATED = ("world", "real_time_factor")


@dataclass(frozen=True)
class CellOptions:
    """Options of `samrl cell`."""

    task: Annotated[str, typer.Option(help="Task to run.")] = DEFAULT_TASK
    episodes: Annotated[int, typer.Option(help="Episodes to run.", min=1)] = 1
    seed: Annotated[int, typer.Option(help="Seed of the first episode; each next one adds 1.", min=0)] = 0
    out: Annotated[Path, typer.Option(help="Folder for bag, summary and picture; must be unused.")] = Path(
        "out/cell"
    )
    view: Annotated[bool, typer.Option("--view", help="Serve the topics to Foxglove on port 8765.")] = False
    layout: Annotated[
        str,
        typer.Option(help="split: computing nodes in own processes; processes: every node; threads: none."),
    ] = LAYOUTS[0]
    update: Annotated[bool, typer.Option(help="Real2Sim update of the model; off for ablations.")] = True
    policy: Annotated[
        str,
        typer.Option(
            help="Nominal actions: learned (the trained actor), optimised (through the model), or touch "
            "(optimised, a peg led by what it touches, a spatula that feels for the plate); without it, the "
            "task's usual one."
        ),
    ] = ""
    strategy: Annotated[
        str,
        typer.Option(help="Views: q, best, fixed or random; without it, q if learned, best if optimised."),
    ] = ""
    weights: Annotated[
        Path | None, typer.Option(help="Folder of trained networks, in place of the package's.")
    ] = None
    residual: Annotated[
        Path | None,
        typer.Option(help="A trained residual's weight file; without it, none, or that of --params."),
    ] = None
    real_time_factor: Annotated[
        float, typer.Option(help="Upper bound on simulated over wall time, 0 for none.", min=0.0)
    ] = REAL_TIME_FACTOR
    max_actions: Annotated[int, typer.Option(help="Actions per episode, 0 for the task's limit.", min=0)] = 0
    world: Annotated[str, typer.Option(help="pybullet, or mock for piping tests.")] = DEFAULT_WORLD
    cell: Annotated[str, typer.Option(help="Arms and camera, by name.")] = DEFAULT_CELL
    instance: Annotated[
        str,
        typer.Option(
            help="The true cell: nominal, typical:SEED or careless:SEED; test:SEED for final tables."
        ),
    ] = NOMINAL
    scale: Annotated[
        tuple[str, ...], typer.Option(help="With --instance: GROUP=FACTOR scales one group of differences.")
    ] = ()
    estop_wait: Annotated[
        float, typer.Option(help="Longest wait for an emergency stop's reset in s, 0 for ever.", min=0.0)
    ] = 0.0
    restarts: Annotated[
        int, typer.Option(help="Restarts of a node's process in a run, 0 for none.", min=0)
    ] = 3
    params: Annotated[Path | None, typer.Option(help="ROS parameter file laid over the defaults.")] = None
    hardware: Annotated[
        tuple[str, ...],
        typer.Option(
            help="A real cell in place of the simulated one: DRIVER or PART=DRIVER, by name or YAML file;"
            " one for each arm, the camera and the segmenter."
        ),
    ] = ()
    observe: Annotated[
        bool, typer.Option("--observe", help="With --hardware: record what drivers say; nothing can move.")
    ] = False
    judge: Annotated[
        str, typer.Option(help="With --hardware: model or operator says whether an episode succeeded.")
    ] = JUDGES[0]
    hand_eye: Annotated[
        Path | None, typer.Option(help="With --hardware: calibration.json of the camera in its flange.")
    ] = None
    bases: Annotated[
        Path | None, typer.Option(help="With --hardware: calibration.json of one arm's base in the other's.")
    ] = None
    correction: Annotated[
        Path | None,
        typer.Option(help="cell.json of `samrl diagnose --apply`: what the cell is known to differ by."),
    ] = None
    sim_time: Annotated[
        bool, typer.Option("--sim-time", help="With --hardware: the drivers are a simulator's, with /clock.")
    ] = False
    node_args: tuple[str, ...] = ()  # further --ros-args

    def __post_init__(self) -> None:
        if not self.policy and self.task in EVERY_TASK:
            object.__setattr__(self, "policy", EVERY_TASK[self.task].usual_policy or DEFAULT_POLICY)
        if not self.strategy and self.policy in RUN_POLICIES:
            object.__setattr__(self, "strategy", STRATEGY_OF[self.policy])

    def as_dict(self) -> dict[str, Any]:
        """Plain values for `summary.json`."""
        data = asdict(self)
        return {k: str(v) if isinstance(v, Path) else v for k, v in data.items()}

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the nodes to start, in order."""
        return nodes_of_run(bool(self.hardware), self.observe)


def prepare(options: CellOptions) -> Path:
    """Check the options, create the run's folder and write its parameter file.

    Returns:
        The parameter file.

    Raises:
        InputError: an unknown task or cell, an out folder in use or not writable, a
            parameter file that does not fit. Nothing is written then.
    """
    task_named(options.task)
    cell_named(options.cell)
    if options.layout not in LAYOUTS:
        raise InputError(f"--layout is {options.layout!r}, must be one of {', '.join(LAYOUTS)}")
    if options.view and importlib.util.find_spec("foxglove") is None:
        raise InputError("--view needs the extra `viz`: pip install -e '.[viz]'")
    if options.episodes < 1:
        raise InputError(f"--episodes is {options.episodes}, must be at least 1")
    if options.policy not in RUN_POLICIES:
        raise InputError(f"--policy is {options.policy!r}, must be one of {', '.join(RUN_POLICIES)}")
    if _leads_peg(options):
        require_peg(task_named(options.task))
    if options.strategy not in STRATEGIES:
        raise InputError(f"--strategy is {options.strategy!r}, must be one of {', '.join(STRATEGIES)}")
    if options.world not in WORLDS:
        raise InputError(f"--world is {options.world!r}, must be one of {', '.join(WORLDS)}")
    instance = InstanceName.parse(options.instance, options.scale)
    if instance.level != NOMINAL and (options.hardware or options.world == "mock"):
        where = "a real cell" if options.hardware else "world 'mock'"
        raise InputError(f"--instance {instance} is for the simulated cell, not for {where}; leave it out")
    if options.hardware:
        require_hardware(options)
    elif given := _given(options, _REAL):
        raise InputError(f"{given[0]} is for a real cell; give --hardware as well")
    if options.correction is not None:
        read_correction(options.correction).require_joints(cell_named(options.cell))
    if not options.observe and (options.policy == "learned" or options.strategy == "q"):
        _require_weights(options)
    if options.residual is not None:
        _require_residual(options, options.residual)
    overlay: dict[str, dict[str, Any]] = {}
    if options.params is not None:
        overlay = load_parameters(options.params, EXECUTABLES)
    _refuse_idle_residual(options, overlay)
    parameters = _parameters(options, overlay)
    out = options.out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} is there already and not an empty folder; choose another --out")
    try:
        out.mkdir(parents=True, exist_ok=True)
        (out / "evaluation").mkdir()
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}; choose another --out") from error
    if not os.access(out, os.W_OK):
        raise InputError(f"{out} is not writable; choose another --out")
    file = out / "params.yaml"
    write_whole(file, yaml.safe_dump(parameters, sort_keys=False))
    return file


def _given(options: CellOptions, names: tuple[str, ...]) -> list[str]:
    """Those options, as they are typed, that are not as they are by default."""
    changed = [f.name for f in fields(options) if f.name in names and getattr(options, f.name) != f.default]
    return [f"--{name.replace('_', '-')}" for name in changed]


def require_hardware(options: CellOptions) -> dict[str, DriverFile]:
    """The drivers of a real cell by part, after a check of all that belongs to them.

    Raises:
        InputError: a driver, calibration or judge that does not fit, a part without a driver, or an option
            of the simulated cell.
    """
    if given := _given(options, _SIMULATED):
        raise InputError(f"{given[0]} is for the simulated cell, not for a real one; leave it out")
    drivers = drivers_by_part(options.hardware)
    missing = [part for part in PARTS if part not in drivers]
    if missing and not options.observe:
        raise InputError(
            f"--hardware names no driver of {', '.join(missing)}; give all, or --observe to hear alone"
        )
    if options.judge not in JUDGES:
        raise InputError(f"--judge is {options.judge!r}, must be one of {', '.join(JUDGES)}")
    calibrated_cell(cell_named(options.cell), options.hand_eye, options.bases)
    return drivers


def _require_weights(options: CellOptions) -> None:
    """Load once what view planner and policy will load: seconds into a run is late for a refusal."""
    from samrl_core.policy.agent.settings import trained_networks

    try:
        trained_networks(options.task, cell_named(options.cell), options.weights)
    except InputError as error:
        raise InputError(
            f"--policy {options.policy} with --strategy {options.strategy} needs trained networks: {error}; "
            "or give --policy optimised --strategy best, which need none"
        ) from error


def _require_residual(options: CellOptions, file: Path) -> None:
    from samrl_core.policy.networks.weights import load_weights

    try:
        load_weights(file, "residual_actor", options.task, cell_named(options.cell))
    except InputError as error:
        raise InputError(f"--residual: {error}") from error


def _leads_peg(options: CellOptions) -> bool:
    return options.policy == TOUCH and felt_surface(task_named(options.task)) is None


def _refuse_idle_residual(options: CellOptions, overlay: dict[str, dict[str, Any]]) -> None:
    if not _leads_peg(options):
        return
    trainer = overlay.get("residual_trainer", {})
    given = {"--residual": options.residual}
    given |= {f"{name} of residual_trainer": trainer.get(name) for name in ("residual", "folder", "train")}
    asked = next((name for name, value in given.items() if value), None)
    if asked is not None:
        raise InputError(
            f"{asked} is for planned actions: a peg that --policy {TOUCH} leads by what it touches has no "
            f"residual; leave it out, or give --policy optimised"
        )


def _parameters(options: CellOptions, overlay: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Contents of the run's parameter file: the options over the user's file.

    Raises:
        InputError: the two contradict each other.
    """
    out = options.out.resolve()
    weights = str(options.weights.resolve()) if options.weights else ""
    ours: dict[str, dict[str, tuple[str, Any]]] = {  # by node and parameter: option and value
        "hardware_bridge": {
            "task": ("--task", options.task),
            "drivers": ("--hardware", [_as_found(name) for name in options.hardware]),
            "observe_only": ("--observe", options.observe),
            "judge": ("--judge", options.judge),
            "hand_eye": ("--hand-eye", str(options.hand_eye.resolve()) if options.hand_eye else ""),
            "bases": ("--bases", str(options.bases.resolve()) if options.bases else ""),
        },
        "sim_bridge": {
            "task": ("--task", options.task),
            "world": ("--world", options.world),
            "instance": ("--instance", str(InstanceName.parse(options.instance, options.scale))),
            "real_time_factor": ("--real-time-factor", options.real_time_factor),
            "evaluation_file": ("--out", str(out / "evaluation" / "truth.jsonl")),
        },
        "manipulator": {"task": ("--task", options.task)},
        "view_planner": {
            "task": ("--task", options.task),
            "strategy": ("--strategy", options.strategy),
            "weights": ("--weights", weights),
            "seed": ("--seed", options.seed),
        },
        "policy": {
            "task": ("--task", options.task),
            "policy": ("--policy", "optimised" if options.policy == TOUCH else options.policy),
            "weights": ("--weights", weights),
            "seed": ("--seed", options.seed),
        },
        "model_updater": {"task": ("--task", options.task), "enabled": ("--update", options.update)},
        "residual_trainer": {"task": ("--task", options.task), "weights": ("--weights", weights)},
        "recorder": {"out": ("--out", str(out / "bag")), "task": ("--task", options.task)},
        "supervisor": {
            "task": ("--task", options.task),
            "episodes": ("--episodes", options.episodes),
            "seed": ("--seed", options.seed),
            "max_actions": ("--max-actions", options.max_actions),
        },
    }
    del ours[BRIDGES[0] if options.hardware else BRIDGES[1]]
    if options.policy == TOUCH:
        for node, name in (("policy", "touch"), ("view_planner", "touch"), ("supervisor", "heed_touch")):
            ours[node][name] = ("--policy", True)
    if options.residual is not None:
        ours["residual_trainer"]["residual"] = ("--residual", str(options.residual.resolve()))
        trained = overlay.get("residual_trainer", {})
        if trained.get("train") or trained.get("folder"):
            raise InputError(
                f"--residual {options.residual} stays as it is, the parameter file gives residual_trainer a "
                f"training; leave out --residual, or train and folder"
            )
    if options.correction is not None:
        bridge = BRIDGES[1] if options.hardware else BRIDGES[0]
        for node in (bridge, "model_updater", "view_planner", "policy"):
            ours[node]["correction"] = ("--correction", str(options.correction.resolve()))
    for owned in ours.values():
        owned["cell"] = ("--cell", options.cell)
    if not options.update:  # a model as it starts knows nothing of when a task is done
        ours["supervisor"]["stop_on_model_success"] = ("--no-update", False)
    merged: dict[str, Any] = {}
    sim_time = options.sim_time or not options.hardware
    for node, owned in ours.items():
        given = overlay.get(node, {})
        if given:
            _refuse_contradiction(node, owned, given)
        values = {name: value for name, (_, value) in owned.items()}
        merged[f"/cell/{node}"] = {"ros__parameters": {"use_sim_time": sim_time, **given, **values}}
    if not options.hardware:
        merged["/cell/sim_bridge"]["ros__parameters"]["use_sim_time"] = False  # it makes the clock
    # Written down always: a replay knows older runs by its absence.
    supervisor = merged["/cell/supervisor"]["ros__parameters"]
    supervisor.setdefault("done_confirmations", LoopSettings.done_confirmations)
    merged["/cell/model_updater"]["ros__parameters"].setdefault("repeat_answers", True)
    for name in ("view_planner", "policy"):
        merged[f"/cell/{name}"]["ros__parameters"].setdefault("images_kept", IMAGES_KEPT)
    supervisor.setdefault("wait_for_reset", OUTLASTS_STOPS)
    merged["/cell/manipulator"]["ros__parameters"].setdefault("heed_stops", OUTLASTS_STOPS)
    return merged


def _as_found(driver: str) -> str:
    """A driver as any process finds it: its YAML file by its absolute path."""
    part, equals, name = driver.rpartition("=")
    return f"{part}{equals}{Path(name).resolve() if name.endswith(('.yaml', '.yml')) else name}"


def _refuse_contradiction(node: str, owned: dict[str, tuple[str, Any]], given: dict[str, Any]) -> None:
    """Options win over a file's defaults, so that a whole copy of the defaults can be laid over a run.

    A file's own value is neither used, or a run's bag would go elsewhere, nor silently dropped.
    """
    from samrl_ros.nodes.registry import all_settings

    defaults = {field.name: field.default for field in fields(all_settings()[node])}
    for name, (option, value) in owned.items():
        if name in given and given[name] not in (value, defaults[name]):
            raise InputError(
                f"the parameter file sets {name} of {node} to {given[name]!r}, {option} says {value!r}; "
                f"give {option} and leave {name} out of the file"
            )
