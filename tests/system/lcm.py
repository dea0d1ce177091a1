# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of LCM share: a network namespace of their own, programs beside the test, messages by hand.

Messages are encoded by the Python that lcm-gen makes of common/lcm, sent as LCM's UDP packets and signed with
Python's hmac: nothing of the code under test.
"""
import hashlib
import hmac
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

GROUP, PORT = "239.255.76.67", 7667
URL = f"udpm://{GROUP}:{PORT}?ttl=0&recv_buf_size=4194304"
MAGIC_SHORT, MAGIC_LONG = 0x4C433032, 0x4C433033


def own_namespace(name):
    """Runs the test again in a network namespace; skips it where none is to be had. Call it before `from tap`."""
    if "DROPTOWER_NAMESPACE" in os.environ:
        return
    os.environ["DROPTOWER_NAMESPACE"] = "1"
    unshare = ["unshare", "-n"] if os.getuid() == 0 else ["unshare", "-rn"]
    setup = "ip link set lo up && ip route add 224.0.0.0/4 dev lo"
    if subprocess.run(unshare + ["sh", "-c", setup], capture_output=True).returncode == 0:
        os.execvp(unshare[0], unshare + ["sh", "-c", setup + ' && exec "$0" "$@"', sys.executable, *sys.argv])
    print(f"1..1\nok 1 - {name} # SKIP no network namespace to be had here")
    sys.exit(0)


class Background:
    """A program that runs beside the test and is ended by its own pid."""

    def __init__(self, words, log, **more):
        self.path = log
        self.log = open(log, "w")
        self.process = subprocess.Popen([str(w) for w in words], cwd=os.path.dirname(os.path.dirname(os.path.dirname(
            os.path.abspath(__file__)))), stdin=subprocess.DEVNULL, stdout=self.log, stderr=subprocess.STDOUT, **more)

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)
        code = self.process.wait(30)
        self.log.close()
        return code

    def text(self):
        with open(self.path) as f:
            return f.read()


def types(build, root):
    """The message types as Python classes."""
    place = os.path.join(build, "tests", "lcm_python")
    os.makedirs(place, exist_ok=True)
    files = [os.path.join(root, "common/lcm", name + ".lcm") for name in ("command", "state", "drop")]
    subprocess.run(["lcm-gen", "-p", "--ppath", place, *files], check=True)
    sys.path.insert(0, place)
    import droptower
    return droptower


def sign(key, channel, data):
    return data[:-32] + hmac.new(key, channel.encode() + b"\0" + data[:-32], hashlib.sha256).digest()


class Sender:
    """LCM's packets, from the interface with this address; without one from the default."""

    def __init__(self, address=None, ttl=0):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, ttl)
        if address:
            self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(address))
        self.number = 0

    def send(self, channel, data, to=GROUP):
        self.number += 1
        self.socket.sendto(struct.pack(">II", MAGIC_SHORT, self.number) + channel.encode() + b"\0" + data, (to, PORT))


class Receiver(threading.Thread):
    """Every short LCM message of this namespace: (channel, bytes)."""

    def __init__(self):
        super().__init__(daemon=True)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4194304)  # this thread may wait for its turn
        self.socket.bind(("", PORT))
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + bytes(4))
        self.messages, self.ended = [], False
        self.start()

    def run(self):
        self.socket.settimeout(0.2)
        while not self.ended:
            try:
                packet = self.socket.recv(65536)
            except socket.timeout:
                continue
            if len(packet) > 8 and struct.unpack(">I", packet[:4])[0] == MAGIC_SHORT:
                channel, _, data = packet[8:].partition(b"\0")
                self.take(channel.decode(errors="replace"), data)

    def take(self, channel, data):
        self.messages.append((channel, data))

    def stop(self):
        self.ended = True
        self.join()
        self.socket.close()


def wait_for(condition, what, patience_s=600):
    end = time.monotonic() + patience_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.01)
    raise AssertionError(f"no {what} within {patience_s} s")
