"""Every way to build the packages ships the same files: wheel, sdist, and the setup.py that colcon uses."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("samrl_core", "samrl_ros")
DEFINITIONS = ("samrl_msgs", "tf2_msgs")  # message definitions, which come from msgs_docs
DEFINED = "samrl_ros/interfaces/definitions"


def is_shipped(name: str) -> bool:
    """Files of the two packages, code as well as data, without what Python leaves behind."""
    path = PurePosixPath(name)
    return path.parts[0] in PACKAGES and "__pycache__" not in path.parts and path.suffix != ".pyc"


def files_below(folder: Path) -> set[str]:
    names = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return {name for name in names if is_shipped(name)}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the builds read, in a folder of its own: setuptools leaves things in the one it builds."""
    folder = tmp_path_factory.mktemp("checkout")
    names = ("pyproject.toml", "setup.py", "package.xml", "constraints.txt", "LICENSE", ".gitignore")
    for name in names:
        shutil.copy(ROOT / name, folder / name)
    junk = shutil.ignore_patterns("__pycache__", "*.pyc", "*.egg-info")
    for package in PACKAGES:
        shutil.copytree(ROOT / package, folder / package, ignore=junk)
    for package in DEFINITIONS:
        shutil.copytree(ROOT / "msgs_docs" / package, folder / "msgs_docs" / package, ignore=junk)
    # What a user's checkout has, and nobody wants to ship
    cache = folder / "samrl_core" / "__pycache__"
    cache.mkdir()
    (cache / "junk.cpython-311.pyc").write_bytes(b"")
    return folder


@pytest.fixture(scope="module")
def source(checkout: Path) -> set[str]:
    return files_below(checkout)


@pytest.fixture(scope="module")
def defined(checkout: Path) -> set[str]:
    """Message definitions, under the names that they have in an installed package."""
    folder = checkout / "msgs_docs"
    return {f"{DEFINED}/{p.relative_to(folder).as_posix()}" for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def in_wheel(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    from hatchling.builders.wheel import WheelBuilder

    out = tmp_path_factory.mktemp("wheel")
    (built,) = WheelBuilder(str(checkout)).build(directory=str(out), versions=["standard"])
    return set(zipfile.ZipFile(built).namelist())


def test_the_wheel_ships_every_file_and_the_message_definitions(
    in_wheel: set[str], source: set[str], defined: set[str]
) -> None:
    assert {name for name in in_wheel if is_shipped(name)} == source | defined
    assert any(name.endswith(".safetensors") for name in source)
    assert any(name.endswith(".html.j2") for name in source)
    assert any(name.endswith(".js") for name in source) and any(name.endswith(".css") for name in source)


def test_setup_py_ships_what_the_wheel_ships(checkout: Path, in_wheel: set[str], tmp_path: Path) -> None:
    command = [sys.executable, "setup.py", "-q", "build_py", "--build-lib", str(tmp_path / "lib")]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    built = {p.relative_to(tmp_path / "lib").as_posix() for p in (tmp_path / "lib").rglob("*") if p.is_file()}
    assert built == {name for name in in_wheel if is_shipped(name)}


def test_the_sdist_holds_all_that_a_build_from_it_needs(
    checkout: Path, source: set[str], tmp_path: Path
) -> None:
    from hatchling.builders.sdist import SdistBuilder

    (built,) = SdistBuilder(str(checkout)).build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(built) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert source <= names
    wanted = {p.relative_to(checkout).as_posix() for p in (checkout / "msgs_docs").rglob("*") if p.is_file()}
    assert wanted | {"setup.py", "pyproject.toml", "package.xml", "constraints.txt"} <= names
