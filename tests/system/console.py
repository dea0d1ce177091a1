# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of the console share: `droptower serve` as a child, its requests, and its stream of events."""
import atexit
import base64
import http.client
import json
import os
import select
import socket
import struct
import subprocess
import sys
import threading
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from tap import *

ME, OTHER = "a" * 16, "b" * 16


def wait_for(condition, what):
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.01)
    raise AssertionError(f"no {what() if callable(what) else what} within {PATIENCE_S} s")


STALLED = "nothing was heard of the tower"
PAST = (STALLED, "nothing was captured")  # troubles that the next ARM takes back


class Stream(threading.Thread):
    """Follows /api/stream: the newest state, and every event with its time."""

    def __init__(self, console, name=ME):
        super().__init__(daemon=True)
        self.console, self.state, self.events, self.ended, self.bad = console, None, [], False, []
        self.connection = http.client.HTTPConnection("127.0.0.1", console.port, timeout=PATIENCE_S)
        self.connection.request("GET", "/api/stream", headers=console.headers(name))
        self.socket = self.connection.sock
        self.answer = self.connection.getresponse()
        equal(self.answer.status, 200, "stream")
        equal(self.answer.getheader("Content-Type"), "text/event-stream", "stream")
        self.start()

    def run(self):
        lines = []
        try:
            for line in self.answer:
                line = line.decode().rstrip("\n")
                if line:
                    lines.append(line)
                else:
                    self.take(lines)
                    lines = []
        except (OSError, ValueError, AttributeError, http.client.HTTPException):
            pass
        self.ended = True

    def take(self, lines):
        if len(lines) != 2 or not lines[0].startswith("event: ") or not lines[1].startswith("data: "):
            self.bad.append(lines)
            return
        name, data = lines[0][7:], json.loads(lines[1][6:])
        self.events.append((time.monotonic(), name, data))
        if name == "state":
            self.state = data

    def wait(self, condition, what):
        """The first state for which condition holds."""
        def look():
            state = self.state
            return state if state and condition(state) else None
        return wait_for(look, lambda: f"{what}; it was {json.dumps(self.state)[:900]}")

    def close(self):
        try:
            self.socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self.join(5)


ATTEMPTS = 10  # at a drop, on a machine that has no time for a heartbeat


class Console:
    """droptower serve on a port of its own; stop() in any case."""

    def __init__(self, *words, build=None, expect_line=True, **more):
        self.process = subprocess.Popen([os.path.join(build or BUILD, "droptower"), "serve", "--port", "0", *map(str, words)],
                                        cwd=ROOT, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                        stderr=subprocess.PIPE, **more)
        atexit.register(self.process.kill)  # whatever becomes of the test
        self.holding, self.streams = None, []
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE_S)
        line = self.process.stdout.readline().decode().strip() if ready else ""
        if not line.startswith("http://127.0.0.1:") or "/#token=" not in line:
            self.process.kill()
            raise AssertionError(f"serve said '{line}'; {self.process.stderr.read().decode()}")
        self.url = line
        self.port = int(line.split(":")[2].split("/")[0])
        self.token = line.split("#token=")[1]

    # ---- requests ----

    def headers(self, name=ME, token=None, **more):
        headers = {"Authorization": f"Bearer {self.token if token is None else token}"}
        if name:
            headers["X-Console"] = name
        headers.update({key.replace("_", "-"): value for key, value in more.items()})
        return headers

    def ask(self, method, path, body=None, headers=None, name=ME, connection=None, timeout=PATIENCE_S):
        """Status, headers and bytes of the answer."""
        own = connection is None
        connection = connection or http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout)
        if isinstance(body, (dict, list)):
            body = json.dumps(body)
        try:
            connection.request(method, path, body, self.headers(name) if headers is None else headers)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()
        finally:
            if own:
                connection.close()

    def post(self, path, body=None, expect=200, name=ME):
        status, _, answer = self.ask("POST", path, {} if body is None else body, name=name)
        if expect is not None and status != expect:
            raise AssertionError(f"POST {path} {body}: {status}, expected {expect}: {answer[:300]}")
        return json.loads(answer) if expect is not None else status

    def get(self, path, expect=200):
        status, headers, answer = self.ask("GET", path)
        if status != expect:
            raise AssertionError(f"GET {path}: {status}, expected {expect}: {answer[:300]}")
        return json.loads(answer) if headers.get("Content-Type") == "application/json" else answer

    def stream(self, name=ME):
        self.streams.append(Stream(self, name))
        return self.streams[-1]

    def hold(self, name=ME):
        """Takes the arm and keeps it, over one connection that stays open."""
        self.post("/api/hold", {"take": True}, name=name)
        self.let_go()
        self.holding = threading.Event()

        def renew(ended):
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE_S)
            try:
                while not ended.wait(2):
                    self.ask("POST", "/api/hold", {"take": True}, name=name, connection=connection)
            except (OSError, http.client.HTTPException):
                pass

        threading.Thread(target=renew, args=(self.holding,), daemon=True).start()

    def let_go(self):
        if self.holding:
            self.holding.set()
            self.holding = None

    # ---- a drop ----

    def series(self, name, scene=SCENE, angle=25, **more):
        scenes = {s["name"]: s for s in self.get("/api/setup")["scenes"]}
        wanted = os.path.basename(scene)[:-4]
        assert wanted in scenes, scenes
        self.post("/api/series", {"name": name, "campaign": "trial", "scene": wanted, "angle_deg": angle, "planned": 5, **more})
        self.post("/api/select", {"series": name})

    def ready(self, stream):
        """At rest, acknowledged and green, also after a pause of the machine that outlasted an ARM or the heartbeat of
        500 ms."""
        while True:
            old = stream.state
            state = stream.wait(lambda s: s is not old and (
                self.is_ready(s) or self.to_acknowledge(s) or
                s["tower"]["state"] == "FAULT_HELD" and s["tower"]["fault"] == "HOST_LOST"), "all checks green")
            if self.is_ready(state):
                return state
            self.post("/api/clear", expect=None)

    @staticmethod
    def to_acknowledge(state):
        """Guards were open, and are good again."""
        red = {c["name"] for c in state["checks"] if not c["green"]}
        return state["tower"]["state"] == "SAFE" and "ACKNOWLEDGE" in red and not red & {"ESTOP", "DOOR", "LATCH", "PRODUCT"}

    @staticmethod
    def is_ready(state):
        tower = state["tower"]
        return (tower["state"] == "READY" and tower["phase"] == "idle" and
                (not tower["trouble"] or any(past in tower["trouble"] for past in PAST)) and
                all(c["green"] for c in state["checks"]))

    def arm(self):
        answer = self.post("/api/arm")
        assert 0 <= answer["token"] < 2**32 and 0 < answer["warning_s"] < answer["expires_s"] <= 60, answer
        return answer["token"]

    def drop(self, stream):
        """Arms, releases, waits for the result; its name."""
        before = self.ready(stream)["archive"]["result"]
        self.let_fall(stream)
        return stream.wait(lambda s: s["archive"]["result"] not in (None, before) and s["tower"]["phase"] == "idle",
                           "result")["archive"]["result"]

    def let_fall(self, stream):
        """ARM and RELEASE. A machine that is too busy for the heartbeat of 500 ms makes the tower refuse: that is said
        and tried again."""
        for attempt in range(ATTEMPTS):
            self.ready(stream)
            if self.release(stream):
                return
            print(f"# attempt {attempt + 1}: no heartbeat for 500 ms on a busy machine; again")
        raise AssertionError(f"no heartbeat for 500 ms in {ATTEMPTS} attempts")

    def release(self, stream):
        """ARM and RELEASE; False when the tower lost the host's heartbeat in between."""
        status, _, answer = self.ask("POST", "/api/arm", {})
        if status == 200:
            token = json.loads(answer)["token"]
            old = stream.state
            state = stream.wait(lambda s: s is not old and (s["tower"]["phase"] != "arming" or
                                                            s["tower"]["fault"] == "HOST_LOST"), "armed")
            if state["tower"]["phase"] == "idle" and state["tower"]["state"] == "READY":
                return False  # it has been, and the tower has let go of it
            status, _, answer = self.ask("POST", "/api/release", {"token": token})
            while status == 425:  # horn and lamp warn
                time.sleep(0.05)
                status, _, answer = self.ask("POST", "/api/release", {"token": token})
        let_go = (b"no host heartbeat", b"start a host", b"not the answer to this ARM", b"nothing is armed")
        if status == 409 and any(why in answer for why in let_go):
            return False
        equal(status, 200, f"ARM and RELEASE: {answer[:300]}")
        return True

    def clear(self):
        """Once the cause is gone: the bench lifts the frame."""
        wait_for(lambda: self.post("/api/clear", expect=None) == 200, "CLEAR")

    # ---- the process ----

    def usage(self):
        """CPU seconds so far and resident megabytes."""
        with open(f"/proc/{self.process.pid}/stat") as f:
            fields = f.read().rsplit(")", 1)[1].split()
        with open(f"/proc/{self.process.pid}/statm") as f:
            pages = int(f.read().split()[1])
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    def kill(self):
        self.let_go()
        self.process.kill()
        self.process.wait()
        self.close_pipes()

    def stop(self, expect=0):
        self.let_go()
        for stream in self.streams:
            stream.close()
        if self.process.poll() is None:
            self.process.terminate()
        try:
            code = self.process.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            raise
        said = self.close_pipes()
        if expect is not None and code != expect:
            raise AssertionError(f"serve ended with {code}, expected {expect}: {said[-1500:]}")
        return said

    def close_pipes(self):
        said = self.process.stderr.read().decode(errors="replace")
        self.process.stdout.close()
        self.process.stderr.close()
        return said

    def __enter__(self):
        return self

    def __exit__(self, kind, *rest):
        if self.process.poll() is None:
            self.stop(expect=0 if kind is None else None)


def samples(block):
    """{name: (rate, start, [values])} and header of a binary answer."""
    size = struct.unpack_from("<I", block)[0]
    header = json.loads(block[4:4 + size])
    at, channels = 4 + size, {}
    for channel in header["channels"]:
        channels[channel["name"]] = (channel["rate_hz"], channel["start_s"],
                                     struct.unpack_from(f"<{channel['count']}f", block, at))
        at += 4 * channel["count"]
    equal(at, len(block), "bytes behind the last channel")
    return header, channels


def envelope(data):
    """Of a live event: ticks of 6 (low, high)."""
    values = base64.b64decode(data["envelope"])
    equal(len(values), data["ticks"] * 24, "bytes of an envelope")
    numbers = struct.unpack(f"<{data['ticks'] * 12}h", values)
    return [[(numbers[12 * t + 2 * c], numbers[12 * t + 2 * c + 1]) for c in range(6)] for t in range(data["ticks"])]
