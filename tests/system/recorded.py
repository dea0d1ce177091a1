# SPDX-License-Identifier: GPL-3.0-or-later
"""Drops that are recorded, and sent again at a live simulated tower: on a bus of processes (test_replay_safety), over
LCM (test_lcm). `make replay-safety` says how many and how often."""
import os
import socket
import struct
import sys
import tempfile
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from person import *

DROPS = int(os.environ.get("DROPTOWER_DROPS", 3))  # recordings
TIMES = int(os.environ.get("DROPTOWER_TIMES", 30))  # each is sent at a ready tower, and as often at an armed one
REAL = 1  # of them, by `ctl` and `run` at the very tower; the others in virtual time

SCENES = ["geometry-1", "geometry-2A", "geometry-2B", "phone"]
STATES = ["BOOT", "SAFE", "READY", "ARMED", "FALLING", "SEPARATED", "BRAKED", "CAPTURED", "UPLOADED", "FAULT_HELD",
          "FAULT_MOVING", "KEEP_OUT"]
FROM_HOST = (0x000, 0x201, 0x301, 0x601, 0x77F)
COMMAND, HEARTBEAT = 0x201, 0x77F
ARM, RELEASE, ABORT, CLEAR, ACCEPT = 1, 2, 3, 4, 5
OUTPUTS, MAGNET_HOLD, WARNING = 31, 2, 16  # latch, magnet, dampers, camera, warning
CLEARED = 3 << 17  # ACKNOWLEDGE and SETTLE
PER_MS = 4  # of the eight frames that the tower takes in a millisecond


class UnixBus:
    """A peer of unix:PATH: packets of 76 bytes, by common/link/unix_bus.c's first lines."""

    def __init__(self, path):
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.connect(path)

    def send(self, frame, data):
        self.socket.send(struct.pack("<IBBBBI64s", frame, 0, len(data), 1, 0, 0, data))

    def receive(self):
        packet = self.socket.recv(76)
        if not packet:
            raise OSError("the tower has ended")
        number, _, length = struct.unpack_from("<IBB", packet)
        return number, packet[12:12 + length]


class Watch(threading.Thread):
    """Counts blocks, and those in which an output is not as it should be: the magnet holds, when armed the warning is on."""

    def __init__(self, bus):
        super().__init__(daemon=True)
        self.bus, self.heard = bus, []  # what only a host may send, in order
        self.state, self.checks, self.hash, self.ticks = None, None, None, 0
        self.but = 0  # what may be otherwise
        self.from_now()
        self.start()

    def from_now(self, outputs=MAGNET_HOLD):
        self.outputs, self.blocks, self.moved, self.replies, self.hosts = outputs, 0, 0, 0, 0

    def run(self):
        try:
            while True:
                self.take(*self.bus.receive())
        except OSError:
            pass  # the tower has ended

    def take(self, number, data):
        if number in (0x181, 0x281):
            self.blocks += 1
            self.ticks += number == 0x181
            self.state = STATES[data[6] & 15]
            io = struct.unpack_from("<H", data, 7)[0]
            self.moved += (io ^ self.outputs) & OUTPUTS & ~self.but != 0
        elif number == 0x684:
            self.replies += 1
        elif number == 0x682:
            self.checks = struct.unpack_from("<I", data, 2)[0]
        elif number == 0x701 and len(data) >= 5:
            self.hash = struct.unpack_from("<I", data, 1)[0]
        elif number in FROM_HOST:
            self.hosts += 1
            self.heard.append((number, bytes(data)))

    def wait(self, condition, what):
        end = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < end, f"no {what}: {self.state}, checks {self.checks}"
            time.sleep(0.005)

    def wait_for_ticks(self, ticks):
        until = self.ticks + ticks
        self.wait(lambda: self.ticks >= until, "blocks")

    def wait_to_clear(self):
        """Nothing but an acknowledgement is to do."""
        self.wait(lambda: self.state == "SAFE" and self.checks is not None and self.checks & ~CLEARED == 0,
                  "tower to acknowledge")

    def at_rest(self, state=None):
        """Nothing moved, and there was enough to see it by."""
        self.wait_for_ticks(100)
        assert self.blocks > 100, self.blocks
        equal(self.moved, 0, f"of {self.blocks} blocks: outputs that moved")
        if state is not None:
            equal(self.state, state)


# ---- recordings -----------------------------------------------------------------------------------------------------


def from_host(frames):
    """What a host sent; of equal heartbeats the first."""
    kept, beat = [], None
    for number, data in frames:
        if number in FROM_HOST and (number != HEARTBEAT or data != beat):
            kept.append((number, data))
            beat = data if number == HEARTBEAT else beat
    return kept


def count(tape, op):
    return sum(number == COMMAND and data[0] == op for number, data in tape)


def read(path):
    frames = []
    with open(path) as f:
        for line in f:
            number, _, data = line.split()[2].partition("#")
            if not data.startswith("#"):
                frames.append((int(number, 16), bytes.fromhex(data)))
    return frames


def write(path, tape):
    """As candump would; apart enough for the tower to take them."""
    with open(path, "w") as f:
        for i, (number, data) in enumerate(tape):
            f.write(f"({1000000000 + i / PER_MS / 1000:.6f}) can0 {number:03X}#{data.hex().upper()}\n")
    return path


def recording():
    """Whole drops as the bench's operator makes them, each of another scene, angle and seed: their hosts' frames, in order."""
    kept, tape = os.environ.get("DROPTOWER_RECORDING"), []
    if kept and os.path.exists(kept):
        tape = read(kept)
    else:
        with tempfile.TemporaryDirectory(prefix="droptower-test-") as folder:
            for seed in range(DROPS - REAL):
                drop = record(folder + "/drop.log", SCENES[seed % len(SCENES)], 12 + 37 * seed % 66, seed + 1)
                ops = [data[0] for number, data in drop if number == COMMAND and data[0] != CLEAR]
                equal(ops, [ARM, ARM, RELEASE, ACCEPT], f"seed {seed + 1}: verbs")
                tape += drop
        if kept:
            write(kept, tape)
    equal(count(tape, RELEASE), DROPS - REAL, "drops recorded")
    return tape


def record(log, scene, angle_deg, seed):
    run("droptower-bench", "--scene", f"common/scenes/{scene}.ini", "--angle", angle_deg, "--seed", seed, "--operate", "--inside",
        "--quiet", "--log", log, timeout=900)
    return from_host(read(log))


# ---- at a tower -----------------------------------------------------------------------------------------------------


def patient(url):
    """A person takes as long as the test, and a busy machine delays a heartbeat."""
    end = time.monotonic() + PATIENCE_S
    for name, value_ms in (("arm_timeout_ms", 60000), ("host_timeout_ms", 5000)):
        while run("droptower", "ctl", "--link", url, "set", name, value_ms, expect=None).returncode != 0:
            assert time.monotonic() < end, f"{name} was not set"  # not before the self-test has ended


def real_drop(watch, url, folder):
    """One of this very tower: `ctl` arms and releases, `run` sets parameters and fetches it. What was heard of them."""
    watch.heard.clear()
    armed = run("droptower", "ctl", "--link", url, "--unattended", "arm", timeout=600, expect=None)
    equal(armed.returncode in (0, 4), True, f"ctl arm, which a busy machine stops following: {armed.err}")
    run("droptower", "run", "--link", url, "--unattended", "--scene", SCENE, "--out", folder, timeout=600,
        expect=5, env=path_without_pictures(folder))  # 5: nothing was released now
    tape = from_host(watch.heard)
    for op, least in ((ARM, 2), (RELEASE, 1), (ACCEPT, 1)):
        assert count(tape, op) >= least, f"verb {op} {count(tape, op)} times"  # on a busy machine one may be said again
    return tape


def send(watch, tape, times):
    """By the tower's own clock, however busy the machine; a peer that only sends would fill the tower's queue."""
    sent, begun = 0, watch.ticks
    for _ in range(times):
        for number, data in tape:
            watch.bus.send(number, data)
            sent += 1
            if sent % (8 * PER_MS) == 0:
                watch.wait(lambda: watch.ticks - begun >= sent / PER_MS - 8, "blocks")
    return sent


def our_program_refuses(watch, log, url):
    """`replay` leaves out what only a host may send; told to send it as a host, it hears that there is a tower."""
    words = ("droptower", "replay", log, "--to", url, "--speed", "max")
    with open(log) as f:
        frames = len(f.readlines())
    assert f"0 sent, {frames} left out" in run(*words).err
    assert "a tower is heard there" in run(*words, "--as-host", expect=5).err
    equal(watch.replies, 0, "answers of the tower")


def moves_nothing(watch, url, folder, again, *words):
    """A person at `droptower run`. again() at the ready and at the armed tower; then this falls for the person's key."""
    with Person("droptower", "run", "--link", url, "--scene", SCENE, "--out", folder, *words,
                env=path_without_pictures(folder)) as person:
        for prompt, key, state, outputs in (("a arms", "c", "READY", MAGNET_HOLD),
                                            ("r releases", "a", "ARMED", MAGNET_HOLD | WARNING)):
            if key == "a" or watch.state != "READY":  # a bridge keeps it ready
                person.wait_for("c acknowledges" if key == "c" else "")
                person.press(key)
            person.wait_for(prompt)
            watch.wait(lambda: watch.state == state, f"{state} tower")
            watch.from_now(outputs)
            said = again()
            watch.at_rest(state)
            print(f"# {state}: {said}, {watch.blocks} blocks, {watch.moved} with an output moved", flush=True)
        person.press("r")
        person.wait_for("collected ")
        assert watch.moved > 100, watch.moved
        person.end(0)


def frames_move_nothing(watch, url, folder, ways):
    """On a bus. ways(tape, log): the ways to send again, each called with times."""
    tape = recording() + real_drop(watch, url, folder)
    print(f"# recorded: {len(tape)} frames of {DROPS} drops, {REAL} of them of this tower", flush=True)
    log, ways = write(folder + "/recorded.log", tape), ways(tape, folder + "/recorded.log")
    verbs = sum(number == COMMAND for number, _ in tape) * TIMES

    def again():
        our_program_refuses(watch, log, url)
        for i, way in enumerate(ways):
            way(TIMES * (i + 1) // len(ways) - TIMES * i // len(ways))
        watch.wait(lambda: watch.replies > 0.9 * verbs, "answers")
        return f"{DROPS} drops {TIMES} times, {len(tape) * TIMES} frames, {watch.replies} of {verbs} verbs answered"

    moves_nothing(watch, url, folder + "/last", again)
