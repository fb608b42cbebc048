"""For colcon alone; pip and uv build with hatchling. All facts are in pyproject.toml."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from setuptools import find_namespace_packages, setup

try:
    import tomllib
except ImportError:  # Python before 3.11, as on the build host of a colcon workspace
    import tomli as tomllib

HERE = Path(__file__).resolve().parent
META = tomllib.loads((HERE / "pyproject.toml").read_text())
WHEEL = META["tool"]["hatch"]["build"]["targets"]["wheel"]

# colcon --symlink-install builds in a folder of links to the packages alone
IN_CHECKOUT = Path("pyproject.toml").exists()

packages = find_namespace_packages(
    include=[name for root in WHEEL["packages"] for name in (root, f"{root}.*")], exclude=["*.__pycache__*"]
)
package_dir = {}
if IN_CHECKOUT:  # what hatchling copies into the package from elsewhere; behind links it is found as it is
    for source, target in WHEEL["force-include"].items():
        for folder in [HERE / source, *sorted(p for p in (HERE / source).rglob("*") if p.is_dir())]:
            name = ".".join([*target.split("/"), *folder.relative_to(HERE / source).parts])
            packages.append(name)
            package_dir[name] = str(folder.relative_to(HERE))

arguments = {
    "packages": packages,
    "package_dir": package_dir,
    # Whatever lies beside the code, as hatchling takes it: a list of suffixes forgets the next one
    "package_data": {"": ["*"]},
    "exclude_package_data": {"": ["*.pyc", ".*"]},
    "data_files": [(os.path.dirname(target), [source]) for source, target in WHEEL["shared-data"].items()],  # noqa: PTH120
}
if not IN_CHECKOUT:
    scripts = META["project"]["scripts"]
    arguments.update(
        name=META["project"]["name"],
        version=META["project"]["version"],
        entry_points={"console_scripts": [f"{name} = {target}" for name, target in scripts.items()]},
    )
distribution = setup(**arguments)
if "--dry-run" in sys.argv:
    # colcon reads repr(distribution) with ast.literal_eval, and a SpecifierSet is no literal
    distribution.python_requires = distribution.metadata.python_requires = None
