"""`python -m tests.faults.wire PID`: a cable from this network namespace to that of PID, which can be bad.

Two TAP devices, every Ethernet frame of which passes through this process: no kernel module such as netem is
needed. A line on standard input sets what happens: `loss SHARE`, `cut`, `mix` (one in ten twice, one in ten
held back by one), `pass`.
"""

from __future__ import annotations

import fcntl
import os
import random
import select
import struct
import subprocess
import sys

from tests.faults.processes import DOES

TUNSETIFF, IFF_TAP, IFF_NO_PI = 0x400454CA, 0x0002, 0x1000
ADDRESSES = ("10.99.0.1", "10.99.0.2")
LONGEST = 65536


def _open(name: str) -> int:
    device = os.open("/dev/net/tun", os.O_RDWR)
    fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", name.encode(), IFF_TAP | IFF_NO_PI))
    return device


def _set_up(name: str, address: str, *host: str) -> None:
    for words in (
        ("address", "add", f"{address}/24", "dev", name),
        ("link", "set", name, "up", "multicast", "on"),
        ("route", "add", "224.0.0.0/4", "dev", name),
    ):
        subprocess.run([*host, "ip", *words], check=True)


def main() -> int:
    """Carry frames until standard input ends; `ready` once the cable is plugged in."""
    pid = sys.argv[1]
    ends = (_open("cable0"), _open("cable1"))
    subprocess.run(["ip", "link", "set", "cable1", "netns", pid], check=True)
    _set_up("cable0", ADDRESSES[0])
    _set_up("cable1", ADDRESSES[1], "nsenter", f"--net=/proc/{pid}/ns/net")
    print("ready", flush=True)
    mode, amount, chance = "pass", 0.0, random.Random(0)
    held: dict[int, bytes] = {}
    while True:
        ready, _, _ = select.select([0, *ends], [], [])
        if 0 in ready:
            line = os.read(0, 100).decode().split()
            if not line:
                return 0
            mode, amount = line[0], float(line[1]) if len(line) > 1 else 0.0
            print(DOES, flush=True)
        for here, there in (ends, ends[::-1]):
            if here not in ready:
                continue
            frame = os.read(here, LONGEST)
            if mode == "cut" or (mode == "loss" and chance.random() < amount):
                continue
            if mode == "mix" and chance.random() < 0.1 and here not in held:
                held[here] = frame
                continue
            os.write(there, frame)
            if mode == "mix" and chance.random() < 0.1:
                os.write(there, frame)
            if here in held:
                os.write(there, held.pop(here))


if __name__ == "__main__":
    sys.exit(main())
