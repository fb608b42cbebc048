"""`ros2 run samrl_ros NODE` finds its executables: checked the way ros2run looks for them."""

from __future__ import annotations

import os
import stat
import subprocess
import sys
import sysconfig
import tomllib
import venv
import xml.etree.ElementTree as ElementTree
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
SHARED = PYPROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["shared-data"]
# The executables of the contract
EXECUTABLES = {
    "cell",
    "sim_bridge",
    "hardware_bridge",
    "model_updater",
    "view_planner",
    "policy",
    "manipulator",
    "residual_trainer",
    "recorder",
    "supervisor",
}


def executables_as_ros2run_finds_them(prefix: Path) -> set[str]:
    """Names in lib/samrl_ros that are executable, of a prefix whose index holds the package."""
    assert (prefix / "share/ament_index/resource_index/packages/samrl_ros").is_file()
    ElementTree.parse(prefix / "share/samrl_ros/package.xml")
    folder = prefix / "lib" / "samrl_ros"
    return {path.name for path in folder.iterdir() if path.is_file() and os.access(path, os.X_OK)}


def test_every_executable_of_the_contract_is_shipped() -> None:
    shipped = {Path(target).name for target in SHARED.values() if target.startswith("lib/samrl_ros/")}
    assert shipped == EXECUTABLES
    for source in SHARED:
        assert (ROOT / source).is_file(), source
        # setuptools, for colcon, keeps the name of the source
        assert Path(source).name == Path(SHARED[source]).name


@pytest.mark.parametrize("name", sorted(EXECUTABLES))
def test_a_launcher_is_executable_and_starts_its_own_node(name: str) -> None:
    path = ROOT / "samrl_ros" / "ament" / name
    assert path.stat().st_mode & stat.S_IXOTH
    assert f"-m samrl_ros.ros2_run {name} " in path.read_text()


def test_package_xml_and_pyproject_agree() -> None:
    root = ElementTree.parse(ROOT / "package.xml").getroot()
    assert root.findtext("version") == PYPROJECT["project"]["version"]
    assert root.findtext("name") == "samrl_ros"
    assert root.findtext("export/build_type") == "ament_python"


def test_this_environment_is_an_ament_prefix_with_the_cell() -> None:
    try:
        metadata.version("samrl")
    except metadata.PackageNotFoundError:
        pytest.skip("samrl is not installed here (make test installs it)")
    assert executables_as_ros2run_finds_them(Path(sys.prefix)) == EXECUTABLES


@pytest.mark.slow
@pytest.mark.parametrize("editable", [False, True])
def test_a_fresh_environment_runs_the_cell_by_its_launcher(
    tmp_path: Path, editable: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("PYTHONPATH", raising=False)  # what is installed is meant
    prefix = tmp_path / "venv"
    venv.create(prefix, with_pip=True)
    python = str(prefix / "bin" / "python")
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    # The dependencies of the running environment, without copying them; its own .pth files count as well.
    link = prefix / "lib" / version / "site-packages" / "borrowed.pth"
    link.write_text(f"import site; site.addsitedir({sysconfig.get_path('platlib')!r})\n")
    source = ["-e", str(ROOT)] if editable else [str(ROOT)]
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-deps", *source], check=True)

    assert executables_as_ros2run_finds_them(prefix) == EXECUTABLES
    result = subprocess.run(
        [str(prefix / "lib/samrl_ros/cell"), "--help"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    assert "--episodes" in result.stdout
    where = "import samrl_ros, pathlib; print(pathlib.Path(samrl_ros.__file__).parent)"
    output = subprocess.run([python, "-c", where], capture_output=True, text=True, cwd=tmp_path, check=True)
    package = Path(output.stdout.strip())
    assert package.is_relative_to(ROOT if editable else prefix)
    if not editable:
        assert (package / "interfaces/definitions/samrl_msgs/msg/ModelState.msg").is_file()
        assert _data_files(ROOT) - _data_files(package.parent) == set()
    find = "from samrl_ros.interfaces.sources import definitions_folder, read_package as read\n"
    find += "print(len(read('samrl_msgs', definitions_folder()).files))"
    output = subprocess.run([python, "-c", find], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert int(output.stdout) == len(list((ROOT / "msgs_docs/samrl_msgs").glob("*/*")))


def _data_files(folder: Path) -> set[str]:
    """Files of the two packages that are not Python: robots, profiles, settings."""
    return {
        path.relative_to(folder).as_posix()
        for package in ("samrl_core", "samrl_ros")
        for path in (folder / package).rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc")
    }
