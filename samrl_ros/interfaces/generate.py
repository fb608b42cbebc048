"""From .msg and .srv files to C, C++ and Python sources, by calling the rosidl generators directly.

The `rosidl generate` command of the wheels writes nothing, so their Python functions are called with
the argument files that rosidl's CMake code would have written.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from samrl_ros.interfaces.sources import InterfacePackage

TYPESUPPORTS = ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c")


@dataclass(frozen=True)
class Generated:
    """Folders of one generated package. `c` and `introspection` hold files of equal names, hence two."""

    package: InterfacePackage
    idl: Path
    c: Path  # .../c/<package>: structures, serialisation, dispatch
    introspection: Path  # .../introspection/<package>
    python: Path  # .../python/<package>: importable once compiled

    @property
    def dependencies(self) -> tuple[str, ...]:
        """ROS packages whose types are used, implicit ones of services included."""
        used = {"builtin_interfaces", "service_msgs"}
        for file in self.idl.rglob("*.idl"):
            for line in file.read_text().splitlines():
                if line.startswith('#include "'):
                    used.add(line.split('"')[1].split("/")[0])
        return tuple(sorted(used - {self.package.name}))


def generate(package: InterfacePackage, work: Path, prefix: Path) -> Generated:
    """Generate all sources of `package` below `work`; `prefix` is where the ROS wheels put `share`."""
    # rosidl looks its templates and dependencies up in the ament index
    os.environ.setdefault("AMENT_PREFIX_PATH", str(prefix))
    out = Generated(
        package=package,
        idl=work / "idl",
        c=work / "c" / package.name,
        introspection=work / "introspection" / package.name,
        python=work / "python" / package.name,
    )
    with contextlib.redirect_stdout(io.StringIO()):  # one line per file
        _write_idl(out)
        _write_sources(out, work, prefix / "share")
    (out.python / "__init__.py").touch()
    return out


def _write_idl(out: Generated) -> None:
    from rosidl_adapter.msg import convert_msg_to_idl
    from rosidl_adapter.srv import convert_srv_to_idl

    convert = {".msg": convert_msg_to_idl, ".srv": convert_srv_to_idl}
    for file in out.package.files:
        folder = out.idl / file.parent
        folder.mkdir(parents=True, exist_ok=True)
        convert[file.suffix](out.package.folder, out.package.name, file, folder)


def _write_sources(out: Generated, work: Path, share: Path) -> None:
    import rosidl_generator_c
    import rosidl_generator_py
    import rosidl_typesupport_c
    import rosidl_typesupport_fastrtps_c
    import rosidl_typesupport_introspection_c
    from rosidl_generator_type_description import generate_type_hash

    idl_files = [str(file.with_suffix(".idl")) for file in out.package.files]

    def arguments(generator: str, output: Path, **more: Any) -> str:
        output.mkdir(parents=True, exist_ok=True)
        content = {
            "package_name": out.package.name,
            "output_dir": str(output),
            "template_dir": str(share / generator / "resource"),
            "idl_tuples": [f"{out.idl}:{file}" for file in idl_files],
            "target_dependencies": [str(out.idl / file) for file in idl_files],
            "ros_interface_dependencies": [],
            **more,
        }
        path = work / f"{generator}.json"
        path.write_text(json.dumps(content))
        return str(path)

    known = [f"{path.name}:{path}" for path in sorted(share.iterdir()) if (path / "msg").is_dir()]
    generate_type_hash(arguments("rosidl_generator_type_description", out.c, include_paths=known))
    hashes = [f"{file}:{(out.c / file).with_suffix('.json')}" for file in idl_files]
    for generator in ("rosidl_generator_c", *TYPESUPPORTS):
        _write_visibility_header(
            out, share / generator / "resource" / f"{generator}__visibility_control.h.in"
        )
    rosidl_generator_c.generate_c(
        arguments(
            "rosidl_generator_c",
            out.c,
            type_description_tuples=hashes,
            ros_interface_files=[str(out.package.folder / file) for file in out.package.files],
        )
    )
    rosidl_typesupport_c.generate_c(arguments("rosidl_typesupport_c", out.c), list(TYPESUPPORTS))
    rosidl_typesupport_fastrtps_c.generate_typesupport_fastrtps_c(
        arguments("rosidl_typesupport_fastrtps_c", out.c)
    )
    rosidl_typesupport_introspection_c.generate_c(
        arguments("rosidl_typesupport_introspection_c", out.introspection)
    )
    rosidl_generator_py.generate_py(arguments("rosidl_generator_py", out.python), ["rosidl_typesupport_c"])


def _write_visibility_header(out: Generated, template: Path) -> None:
    """Fill the two names into a header that CMake would have configured."""
    name = out.package.name
    text = template.read_text().replace("@PROJECT_NAME@", name).replace("@PROJECT_NAME_UPPER@", name.upper())
    path = out.c / "msg" / template.name.removesuffix(".in")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)
