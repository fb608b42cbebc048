"""Shared memory that killed processes left goes; what a living participant uses stays."""

from __future__ import annotations

import fcntl
import mmap
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

pytest.importorskip("rclpy")

from samrl_core.blind_test.scores.diagnosis_run import can_hide
from samrl_ros.hosting import shared_memory
from samrl_ros.hosting.shared_memory import leftovers, pass_over_dead_ports, remove_leftovers

pytestmark = pytest.mark.ros
SEGMENT, OTHER = "fastrtps_0123456789abcdef", "fastrtps_fedcba9876543210"
PORT, PARTICIPANT = "fastrtps_port7411", "fastrtps_port7001"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A segment with 2 MiB, another one, a port with both kinds of lock, and what is not Fast DDS'."""
    for name in (SEGMENT, OTHER, PORT):
        (tmp_path / name).write_bytes(bytes(2**21))
        (tmp_path / f"{name}_el").touch()
    (tmp_path / f"{PORT}_sl").touch()
    (tmp_path / f"sem.{PORT}_mutex").touch()
    for name in ("psm_1234", "fastrtps_0123456789abcdef_elx", "xfastrtps_port1_el"):
        (tmp_path / name).touch()
    for file in tmp_path.iterdir():
        os.utime(file, (0, 0))
    return tmp_path


@pytest.fixture
def owned(folder: Path) -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


def own(stack: ExitStack, lock: Path, how: int = fcntl.LOCK_EX) -> None:
    fcntl.flock(stack.enter_context(lock.open("ab")), how)


def test_what_nobody_owns_goes_and_nothing_else(folder: Path, owned: ExitStack) -> None:
    own(owned, folder / f"{OTHER}_el")
    assert {one.name: one.size for one in leftovers(folder)} == {SEGMENT: 2**21, PORT: 2**21}
    assert {one.name for one in remove_leftovers(folder)} == {SEGMENT, PORT}
    rest = {OTHER, f"{OTHER}_el", "psm_1234", "fastrtps_0123456789abcdef_elx", "xfastrtps_port1_el"}
    assert {file.name for file in folder.iterdir()} == rest


@pytest.mark.parametrize(("end", "how"), [("el", fcntl.LOCK_EX), ("sl", fcntl.LOCK_SH)])
def test_a_port_with_one_listener_stays(folder: Path, owned: ExitStack, end: str, how: int) -> None:
    own(owned, folder / f"{PORT}_{end}", how)
    assert PORT not in {one.name for one in remove_leftovers(folder)}
    assert (folder / PORT).exists() and (folder / f"sem.{PORT}_mutex").exists()


def test_what_is_just_being_made_stays(folder: Path) -> None:
    (folder / f"{SEGMENT}_el").touch()
    assert SEGMENT not in {one.name for one in remove_leftovers(folder)}


def test_another_user_s_stays(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "getuid", lambda: 12345678)
    assert remove_leftovers(folder) == () and (folder / SEGMENT).exists()


def is_free(lock: Path) -> bool:
    with lock.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True


def test_a_port_that_somebody_still_writes_to_stays(folder: Path) -> None:
    with (folder / PORT).open("r+b") as file, mmap.mmap(file.fileno(), 0):
        assert {one.name for one in remove_leftovers(folder)} == {SEGMENT, OTHER}
    assert {one.name for one in remove_leftovers(folder)} == {PORT}


def test_ports_of_killed_processes_are_taken_and_nothing_else(
    folder: Path, owned: ExitStack, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: list[ExitStack] = []
    monkeypatch.setattr(shared_memory, "_passed_over", taken)
    lived_in = folder / "fastrtps_port7413_el"
    for lock in (lived_in, folder / f"{PARTICIPANT}_el"):
        lock.touch()
    own(owned, lived_in)
    assert pass_over_dead_ports(folder) == (7411,) and pass_over_dead_ports(folder) == ()
    assert not is_free(folder / f"{PORT}_el") and not is_free(lived_in)
    assert is_free(folder / f"{SEGMENT}_el") and is_free(folder / f"{PARTICIPANT}_el")
    for lock in taken:
        lock.close()
    assert is_free(folder / f"{PORT}_el")


# In a name space where /dev/shm is empty: two participants talk, one is killed and followed by a third, which
# hears although the port of the killed one says that its listener was between two messages (written into it:
# Fast DDS 2.14 is in that state for a microsecond a message, and no writer ever leaves such a port).
PARTICIPANTS = """
import mmap, signal, subprocess, sys, time
from pathlib import Path

TALK = '''
import sys, time
import rclpy
from std_msgs.msg import String
from samrl_ros.hosting.host import start_ros
start_ros([])
node = rclpy.create_node(sys.argv[1])
publisher = node.create_publisher(String, "said", 1)
heard = []
node.create_subscription(String, "said", lambda message: heard.append(message.data), 1)
print("ready", flush=True)
known = {sys.argv[1]}
end = time.monotonic() + 120.0
while time.monotonic() < end:
    publisher.publish(String(data=sys.argv[1]))
    rclpy.spin_once(node, timeout_sec=0.02)
    if set(heard) - known:  # told once: a pipe that nobody reads fills, and holds the talker
        print("heard", *sorted(set(heard) - known), flush=True)
        known |= set(heard)
    heard.clear()
'''
SHM = Path("/dev/shm")
NUMBER, STATUS, IN_USE, WAITING = 276, 20888, 1, 2  # of a port of Fast DDS 2.14.5: offsets [bytes] and bits

def start(name):
    return subprocess.Popen([sys.executable, "-c", TALK, name], stdout=subprocess.PIPE, text=True)

def hears(process, text):
    return any(text in line for line in process.stdout)

def between_two_messages(port):
    with (SHM / port).open("r+b") as file, mmap.mmap(file.fileno(), 0) as memory:
        assert memory[NUMBER : NUMBER + 4] == int(port[len("fastrtps_port") :]).to_bytes(4, "little")
        assert memory[STATUS] & IN_USE, "one listener"
        memory[STATUS] = IN_USE

from samrl_ros.hosting.shared_memory import remove_leftovers
names = lambda: {p.name for p in SHM.glob("fastrtps_*") if p.name[-3:] not in ("_el", "_sl")}
living = start("living")
assert hears(living, "ready")
of_living = names()
killed = start("killed")
assert hears(living, "heard killed") and hears(killed, "heard living")
assert not remove_leftovers(young_s=0.0), "both live"
of_killed = names() - of_living
(port,) = (name for name in of_killed if "_port" in name and int(name[len("fastrtps_port") :]) >= 7411)
killed.kill()
killed.wait()
between_two_messages(port)
gone = {one.name for one in remove_leftovers(young_s=0.0)}
left = names()
third = start("third")
segments = {name for name in of_killed if "_port" not in name}
print(bool(of_killed), gone == segments, of_living <= left, hears(living, "heard third"))
print("the third", "hears" if hears(third, "heard living") else "is deaf")
third.terminate()
living.terminate()
"""


# In such a name space too: a node of the cell that is asked to stop.
NODE = """
import signal, subprocess, sys, time
from pathlib import Path

node = subprocess.Popen([sys.executable, "-m", "samrl_ros.ros2_run", "supervisor"], stderr=subprocess.STDOUT)
while not list(Path("/dev/shm").glob("fastrtps_*_el")):
    assert node.poll() is None
    time.sleep(0.1)
time.sleep(3.0)  # the node comes up
node.send_signal(signal.SIGINT)
code = node.wait()
from samrl_ros.hosting.shared_memory import leftovers
print(code, [one.name for one in leftovers(young_s=0.0)])
"""


@pytest.mark.live
@pytest.mark.skipif(not can_hide(), reason="this system gives no mount name space")
@pytest.mark.parametrize(
    ("text", "said"), [(PARTICIPANTS, "True True True True\nthe third hears"), (NODE, "0 []")]
)
def test_a_killed_one_s_successor_hears_and_ended_nodes_leave_nothing(
    text: str, said: str, tmp_path: Path
) -> None:
    program = tmp_path / "program.py"
    program.write_text(text)
    environment = {k: v for k, v in os.environ.items() if k != "FASTDDS_BUILTIN_TRANSPORTS"}
    script = f"mount -t tmpfs none /dev/shm && exec '{sys.executable}' '{program}'"
    command = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=600)
    assert done.stdout.strip().endswith(said), done.stdout + done.stderr
