"""The constraints file pins everything that pyproject.toml asks for, and no CUDA."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
PINS: dict[str, str] = {
    str(canonicalize_name(name)): version
    for name, version in re.findall(r"^([\w.\-]+)==(\S+)$", (ROOT / "constraints.txt").read_text(), re.M)
}


def test_every_dependency_is_pinned_to_a_version_that_it_allows() -> None:
    extras = PROJECT["optional-dependencies"].values()
    for text in [*PROJECT["dependencies"], *(text for extra in extras for text in extra)]:
        requirement = Requirement(text)
        pin = PINS.get(canonicalize_name(requirement.name))
        assert pin is not None, f"{requirement.name} is not in constraints.txt"
        assert requirement.specifier.contains(pin), f"{text} does not allow the pin {pin}"


def test_torch_is_the_cpu_build_and_nothing_of_cuda_is_pinned() -> None:
    assert PINS["torch"].endswith("+cpu")
    assert not [name for name in PINS if name.startswith(("nvidia-", "triton", "cuda"))]


def test_ros_is_asked_for_by_distribution_and_exact_version() -> None:
    for text in PROJECT["optional-dependencies"]["ros"]:
        requirement = Requirement(text)
        assert requirement.name.startswith("ros-jazzy-") and str(requirement.specifier).startswith("==")
