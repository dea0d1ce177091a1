# SPDX-License-Identifier: GPL-3.0-or-later
"""What the system tests share: TAP output, running our programs, temporary folders.

A test is a function named test_*; it passes unless it raises. `skip(why)` marks it skipped.
"""
import csv
import importlib.util
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import zlib

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
BUILD = os.path.abspath(sys.argv[1] if len(sys.argv) > 1 else "build")
SANITIZED = os.path.abspath(sys.argv[2] if len(sys.argv) > 2 else "build/sanitize")
SHARED_DATA = os.path.join(ROOT, "..", "shared", "data")
PATIENCE_S = 1500  # what takes longer hangs, on a busy machine too; tests/run ends a suite that does nothing earlier
SCENE = "common/scenes/geometry-2A.ini"
os.environ.setdefault("DROPTOWER_JOURNAL", os.path.join(BUILD, "tests", "journal.log"))  # not the one of who runs this


class Skip(Exception):
    pass


def skip(why):
    raise Skip(why)


def run(*words, build=None, expect=0, timeout=PATIENCE_S, **more):
    """Runs build/<words[0]> with the other words; fails unless it exits with expect (None: any)."""
    command = [os.path.join(build or BUILD, words[0])] + [str(w) for w in words[1:]]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=timeout, stdin=subprocess.DEVNULL, **more)
    done.out, done.err = done.stdout.decode(errors="replace"), done.stderr.decode(errors="replace")
    if expect is not None and done.returncode != expect:
        raise AssertionError(f"{' '.join(command)}: exit {done.returncode}, expected {expect}\n{done.err[-2000:]}")
    return done


def analyze(*words, **more):
    """droptower analyze --json: the objects it prints."""
    done = run("droptower", "analyze", "--json", *words, **more)
    return [json.loads(line) for line in done.out.splitlines() if line.strip()]


def equal(got, wanted, what=""):
    if got != wanted:
        raise AssertionError(f"{what}: got {str(got)[:300]}, expected {str(wanted)[:300]}")


def within(value, low, high, what=""):
    if value is None or not low <= value <= high:
        raise AssertionError(f"{what}: {value} is not within {low} to {high}")


def plain_csv(file):
    """Its rows by name, read as pandas.read_csv does without options: a line of names, as many cells in each row, no comment."""
    with open(file, newline="", encoding="utf-8") as f:
        names, *rows = csv.reader(f)
    equal(len(set(names)), len(names), f"{file}: {names}")
    assert all(names) and not names[0].startswith("#"), f"{file}: {names}"
    for row in rows:
        equal(len(row), len(names), f"{file}: {row}")
    if importlib.util.find_spec("pandas"):
        import pandas
        read = pandas.read_csv(file)
        equal((list(read.columns), len(read)), (names, len(rows)), f"{file}: by pandas")
    return [dict(zip(names, row)) for row in rows]


def csv_text(file):
    """Lines of our CSV as text with a head (version 1), by host/record/README.md: tests read and edit that form."""
    with open(file) as f:
        lines = f.read().splitlines()
    if not lines[0].endswith(",marks,droptower_csv_2"):
        return lines
    names, head, rows = lines[0].split(",")[:-2], [], []
    for line in lines[1:]:
        *cells, marks, about = line.split(",")
        for mark in filter(None, marks.split(";")):
            i = next(i for i in reversed(range(len(names))) if mark.startswith(names[i].removesuffix("_g") + " "))
            words = mark[len(names[i]) - 1:].split(" ")
            cells[i] = next((word for word in words if word in ("lost", "bad")), cells[i]) + "*" * ("clipped" in words)
        head += ["# " + about] if about else []
        rows += [",".join(cells)] if any(cells) else []
    seal = [line for line in head if line.startswith("# sha256 ")]
    return ["# droptower csv 1"] + [line for line in head if line not in seal] + [",".join(names)] + rows + seal


def stretch():
    """How many times longer than on an idle machine things take now: wall time over processor time, 1 at least."""
    begun, spent = time.monotonic(), time.process_time()
    while time.process_time() - spent < 0.05:
        pass
    return max(1, (time.monotonic() - begun) / 0.05)


def numbered(text, number):
    """The log with another CRC-32 in its capture end: the same capture is not added twice, this is another one."""
    def seal(found):
        data = bytes.fromhex(found[2])[:16] + number.to_bytes(4, "big") + bytes.fromhex(found[2])[20:28]
        return found[1] + (data + zlib.crc32(data).to_bytes(4, "little")).hex().upper()

    return re.sub("(681##1)(.{64})", seal, text)


def path_without_pictures(folder):
    """An environment whose gnuplot draws an empty picture for each of a page: the real one takes longer than the drop."""
    os.makedirs(folder + "/bin", exist_ok=True)
    with open(folder + "/bin/gnuplot", "w", encoding="utf-8") as f:
        f.write("#!/bin/sh\nsed -n 's|^undefine.*|<svg></svg>|p'\n")
    os.chmod(folder + "/bin/gnuplot", 0o755)
    return dict(os.environ, PATH=folder + "/bin:" + os.environ["PATH"])


def main(namespace):
    """All tests, or those that stand behind the two build folders."""
    tests = [(name, f) for name, f in namespace.items() if name.startswith("test_") and callable(f)]
    tests = [(name, f) for name, f in tests if name in (sys.argv[3:] or [name])]
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # through what cleans up
    print(f"1..{len(tests)}", flush=True)
    failed = False
    for number, (name, test) in enumerate(tests, 1):
        folder = tempfile.mkdtemp(prefix="droptower-test-")
        try:
            test(folder)
            print(f"ok {number} - {name}", flush=True)
        except Skip as why:
            print(f"ok {number} - {name} # SKIP {why}", flush=True)
        except Exception:
            failed = True
            print(f"not ok {number} - {name}")
            print("\n".join("# " + line for line in traceback.format_exc().splitlines()), flush=True)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    sys.exit(failed)
