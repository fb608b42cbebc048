"""Labels and oracles put away as one file whose hash can be published before anybody is asked."""

from __future__ import annotations

import hashlib
import io
import json
import tarfile
from pathlib import Path

import numpy as np

from samrl_core.errors import InputError
from samrl_core.forge.world import Oracle
from samrl_core.types.arm_recording import JointSignal

SEALED = "sealed"
ARCHIVE = "sealed.tar"
_SIGNALS = ("effect_states", "effect_commanded", "nominal_states", "nominal_commanded")


def write_truth(folder: Path, label: dict, oracle: Oracle) -> None:
    """Write `<id>.npz`, then `<id>.json`: a label that is there says that its world is complete."""
    folder.mkdir(parents=True, exist_ok=True)
    arrays = {}
    for name in _SIGNALS:
        signal: JointSignal = getattr(oracle, name)
        for part in ("time", "position", "velocity", "effort"):
            values = getattr(signal, part)
            if values is not None:
                arrays[f"{name}.{part}"] = values.astype(np.float64 if part == "time" else np.float32)
    (folder / f"{label['id']}.npz").write_bytes(_npz(arrays))
    temporary = folder / f"{label['id']}.json.part"
    temporary.write_text(json.dumps(label, indent=1, sort_keys=True) + "\n")
    temporary.replace(folder / f"{label['id']}.json")


def _npz(arrays: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    return buffer.getvalue()


def read_oracle(path: Path) -> Oracle:
    """An oracle that `write_truth` wrote.

    Raises:
        InputError: no such file, or not one of these.
    """
    if not path.is_file():
        raise InputError(f"no oracle at {path}; give sealed/<id>.npz")
    with np.load(path) as data:
        if f"{_SIGNALS[0]}.time" not in data:
            raise InputError(f"{path} is no oracle; it holds {sorted(data)}")
        signals = [
            JointSignal(
                **{
                    part: data[f"{name}.{part}"].astype(float)
                    for part in ("time", "position", "velocity", "effort")
                    if f"{name}.{part}" in data
                }
            )
            for name in _SIGNALS
        ]
    return Oracle(*signals)


def seal(folder: Path) -> str:
    """Pack `folder/sealed` into `folder/sealed.tar`, the same bytes for the same truth; returns its SHA-256.

    Raises:
        InputError: nothing to seal.
    """
    files = sorted(p for p in (folder / SEALED).glob("*") if p.suffix in (".json", ".npz"))
    if not files:
        raise InputError(f"nothing in {folder / SEALED}; make worlds first")
    with tarfile.open(folder / ARCHIVE, "w", format=tarfile.USTAR_FORMAT) as archive:
        for path in files:
            entry = tarfile.TarInfo(f"{SEALED}/{path.name}")
            entry.size = path.stat().st_size
            with path.open("rb") as stream:  # no owner, no time: only what is true
                archive.addfile(entry, stream)
    return archive_hash(folder)


def archive_hash(folder: Path) -> str:
    """SHA-256 of `folder/sealed.tar`.

    Raises:
        InputError: no archive.
    """
    path = folder / ARCHIVE
    if not path.is_file():
        raise InputError(f"no {path}; seal the worlds first")
    digest = hashlib.sha256()
    with path.open("rb") as stream:
        while chunk := stream.read(1 << 20):
            digest.update(chunk)
    return digest.hexdigest()


def check_seal(folder: Path) -> dict:
    """What `forge.json` says, after its hash was compared with the archive.

    Raises:
        InputError: no `forge.json`, or the truth was changed after it was published.
    """
    path = folder / "forge.json"
    if not path.is_file():
        raise InputError(f"no {path}; give a folder that a forge made")
    published = json.loads(path.read_text())
    found = archive_hash(folder)
    if found != published["sealed_sha256"]:
        raise InputError(
            f"{folder / ARCHIVE} has SHA-256 {found}, published was {published['sealed_sha256']}"
        )
    return published
