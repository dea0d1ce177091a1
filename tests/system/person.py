# SPDX-License-Identifier: GPL-3.0-or-later
"""A person at a terminal: a program of ours on a pseudo terminal, what it says, and the keys that are pressed."""
import os
import pty
import select
import signal
import subprocess
import sys
import termios
import time

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from tap import *



class Person:
    def __init__(self, *words, build=None, **more):
        self.terminal, own = pty.openpty()
        self.before = termios.tcgetattr(own)
        self.own, self.said, self.read_to = own, "", 0
        command = [os.path.join(build or BUILD, words[0])] + [str(w) for w in words[1:]]
        # what it says goes to the same terminal; a session of its own, so that Ctrl-C is the terminal's
        self.process = subprocess.Popen(command, cwd=ROOT, stdin=own, stdout=own, stderr=own, start_new_session=True,
                                        preexec_fn=lambda: __import__("fcntl").ioctl(0, termios.TIOCSCTTY, 0), **more)

    def hear(self, seconds):
        if select.select([self.terminal], [], [], seconds)[0]:
            self.said += os.read(self.terminal, 65536).decode(errors="replace")

    def wait_for(self, text):
        """Until it has said text, behind all that was waited for before."""
        end = time.monotonic() + PATIENCE_S
        while text not in self.said[self.read_to:]:
            if time.monotonic() > end or (self.process.poll() is not None and not self.hear(0.2)
                                          and text not in self.said[self.read_to:]):
                raise AssertionError(f"never said '{text}', but:\n{self.said[-2500:]}")
            self.hear(0.05)
        self.read_to = self.said.index(text, self.read_to) + len(text)

    def press(self, keys):
        os.write(self.terminal, keys.encode())

    def end(self, expect=None):
        """Its exit code; the terminal is as it was."""
        end = time.monotonic() + PATIENCE_S
        while self.process.poll() is None:
            if time.monotonic() > end:
                self.process.kill()
                raise AssertionError(f"did not end:\n{self.said[-2500:]}")
            self.hear(0.05)
        self.hear(0)
        code = self.process.wait()
        after = termios.tcgetattr(self.own)
        os.close(self.own)
        os.close(self.terminal)
        if expect is not None and code != expect:
            raise AssertionError(f"exit {code}, expected {expect}:\n{self.said[-2500:]}")
        equal(after, self.before, "the terminal's settings")
        return code

    def __enter__(self):
        return self

    def __exit__(self, kind, *rest):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()
