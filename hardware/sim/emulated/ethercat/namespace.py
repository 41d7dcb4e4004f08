"""A network of one's own: two ends of a virtual cable in a namespace, without being root.

An EtherCAT master and its slaves talk in raw Ethernet frames, which needs privileges on a real network. Linux grants
them to anybody in a user namespace of their own with a network namespace inside. The emulator makes both; whoever
drives the emulated slaves opens its socket in there, from a thread that enters the network and ends with that: sockets
stay where they were opened, and everything else of the process stays where it was.

Only a process of a single thread may make or enter a user namespace, which has to be before numpy is loaded: nothing of
ours is imported here. Root needs no user namespace, and makes none.
"""

import ctypes
import fcntl
import os
import socket
import struct
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

MASTER_END, SLAVES_END = "ecat0", "ecat1"
"""Names of the cable's ends."""
NETWORK_FILE: Final = "network.pid"
"""In the run directory: the process whose network the cable is in."""
PATIENCE: Final = 60.0
"""Within which the emulator has made its network [s]."""
_USER, _NETWORK = 0x10000000, 0x40000000
"""``CLONE_NEWUSER``, ``CLONE_NEWNET``."""
_CAP_SYS_ADMIN: Final = 1 << 21
_SET_FLAGS, _GET_FLAGS, _UP = 0x8914, 0x8913, 1
_NEW_LINK, _REQUEST, _ACKNOWLEDGE, _CREATE, _EXCLUSIVE = 16, 1, 4, 0x400, 0x200
_LINK_INFO, _KIND, _DATA, _NAME, _PEER = 18, 1, 2, 3, 1
_FORBIDDEN: Final = (
    "on this system only root may create a network namespace ({}): allow user namespaces "
    "(sysctl kernel.unprivileged_userns_clone=1, or kernel.apparmor_restrict_unprivileged_userns=0), or run as root"
)
Result = TypeVar("Result")


class NoNetwork(Exception):
    """The system does not let an ordinary user make a network of their own; the sentence says what to allow."""


def privileged() -> bool:
    """Whether this process may make network namespaces as it is."""
    for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
        if line.startswith("CapEff:"):
            return bool(int(line.split()[1], 16) & _CAP_SYS_ADMIN)
    return False


def make_network() -> None:
    """Move this process, of one thread unless it is privileged, into a network with a cable; raises ``NoNetwork``."""
    user, group = os.geteuid(), os.getegid()
    try:
        if privileged():
            _call("unshare", _NETWORK)
        else:
            _call("unshare", _USER | _NETWORK)
            Path("/proc/self/setgroups").write_text("deny", encoding="ascii")
            Path("/proc/self/uid_map").write_text(f"{user} {user} 1", encoding="ascii")
            Path("/proc/self/gid_map").write_text(f"{group} {group} 1", encoding="ascii")
    except OSError as error:
        raise NoNetwork(_FORBIDDEN.format(error.strerror)) from error
    _make_cable(MASTER_END, SLAVES_END)
    for end in (MASTER_END, SLAVES_END):
        set_link(end, up=True)


def shares_user_namespace(pid: int) -> bool:
    """Whether a process is in the user namespace of this one."""
    theirs, ours = (Path(f"/proc/{one}/ns/user") for one in (pid, "self"))
    return theirs.stat().st_ino == ours.stat().st_ino


def join_user_namespace(pid: int) -> None:
    """Enter the user namespace in which a process has made its network; of a privileged one it is one's own already.

    Raises ``NoNetwork`` if this process has several threads, or the other is gone or somebody else's.
    """
    try:
        if not shares_user_namespace(pid):
            with Path(f"/proc/{pid}/ns/user").open("rb") as namespace:
                _call("setns", namespace.fileno(), _USER)
    except OSError as error:
        raise NoNetwork(
            f"the network of process {pid} cannot be entered ({error.strerror}): is it a running world of the same "
            "user, and does this process have only one thread?"
        ) from error


def announce(run_dir: Path) -> None:
    """Leave word in a run directory that this process has made its network; ``NoNetwork``: nobody would find it."""
    new = run_dir / f"{NETWORK_FILE}.new"
    try:
        new.write_text(str(os.getpid()), encoding="ascii")
        new.replace(run_dir / NETWORK_FILE)
    except OSError as error:
        raise NoNetwork(
            f"nothing can be written in {run_dir} ({error.strerror}): start the world through its rig"
        ) from error


def network_pid(run_dir: Path, patience: float = PATIENCE) -> int:
    """The process whose network the cable is in, waited for [s]; raises ``NoNetwork``."""
    deadline = time.monotonic() + patience
    while not (run_dir / NETWORK_FILE).exists():
        if time.monotonic() > deadline:
            raise NoNetwork(
                f"no emulated EtherCAT devices have started in {run_dir} for {patience:.0f} s: see its logs"
            )
        time.sleep(0.005)
    return int((run_dir / NETWORK_FILE).read_text(encoding="ascii"))


def within_network(pid: int, work: Callable[[], Result]) -> Result:
    """Do some work in a thread within the network of a process, and say what came of it; its sockets stay there.

    Raises ``NoNetwork`` if this process may not enter it, see ``join_user_namespace``, and what the work raises.
    """
    came: list[Result] = []
    failed: list[BaseException] = []

    def enter() -> None:
        try:
            _join_network(pid)
            came.append(work())
        except BaseException as error:  # told to whoever waits for it
            failed.append(error)

    thread = threading.Thread(target=enter, name="network")
    thread.start()
    thread.join()
    if failed:
        raise failed[0]
    return came[0]


def _join_network(pid: int) -> None:
    """Of this thread alone."""
    try:
        with Path(f"/proc/{pid}/ns/net").open("rb") as namespace:
            _call("setns", namespace.fileno(), _NETWORK)
    except OSError as error:
        raise NoNetwork(
            f"the network of process {pid} cannot be entered ({error.strerror}): start this program by "
            f"'python -P -m hardware.sim.emulated.ethercat.enter_namespace {pid} -m MODULE ...', or run it as root"
        ) from error


def raw_socket(interface: str, ethertype: int) -> socket.socket:
    """A socket that gets and sends whole frames of one kind."""
    raw = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ethertype))
    try:
        raw.bind((interface, ethertype))
    except BaseException:
        raw.close()
        raise
    return raw


def set_link(interface: str, *, up: bool) -> None:
    """Plug the cable in at one end, or pull it."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        request = struct.pack("16sH14x", interface.encode(), 0)
        (flags,) = struct.unpack_from("H", fcntl.ioctl(any_socket, _GET_FLAGS, request), 16)
        flags = flags | _UP if up else flags & ~_UP
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("16sH14x", interface.encode(), flags))


def _make_cable(one: str, other: str) -> None:
    """A pair of virtual Ethernet interfaces, as ``ip link add ONE type veth peer name OTHER`` makes it."""
    peer = struct.pack("BxHiII", socket.AF_UNSPEC, 0, 0, 0, 0) + _attribute(_NAME, other.encode() + b"\0")
    info = _attribute(_KIND, b"veth") + _attribute(_DATA, _attribute(_PEER, peer))
    body = struct.pack("BxHiII", socket.AF_UNSPEC, 0, 0, 0, 0)
    body += _attribute(_NAME, one.encode() + b"\0") + _attribute(_LINK_INFO, info)
    flags = _REQUEST | _ACKNOWLEDGE | _CREATE | _EXCLUSIVE
    with socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, socket.NETLINK_ROUTE) as kernel:
        kernel.send(struct.pack("IHHII", 16 + len(body), _NEW_LINK, flags, 1, 0) + body)
        (error,) = struct.unpack_from("i", kernel.recv(4096), 16)
    if error:
        raise NoNetwork(f"the kernel makes no virtual cable ({os.strerror(-error)}): load its module 'veth'")


def _attribute(kind: int, data: bytes) -> bytes:
    return struct.pack("HH", 4 + len(data), kind) + data + b"\0" * (-len(data) % 4)


def _call(name: str, *arguments: int) -> None:
    """A function of the C library that returns 0; raises ``OSError`` otherwise."""
    if getattr(ctypes.CDLL(None, use_errno=True), name)(*arguments):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
