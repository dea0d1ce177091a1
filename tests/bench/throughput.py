# SPDX-License-Identifier: GPL-3.0-or-later
"""tests/bench/throughput.py BUILD LOG: what the program takes in, in processor time of the process, its start taken
off; beside it other people's readers of the same file, where they are installed. LOG is a simulated drop's."""
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time

TIMES = 5  # the best of so many
COPIES = 20  # of a drop in a log
PROGRAM, LOG = os.path.join(sys.argv[1], "droptower"), os.path.abspath(sys.argv[2])
BENCH = os.path.join(sys.argv[1], "droptower-bench")


def children_s():
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def run(*words, clean=()):
    """Processor seconds, the best of several."""
    best = float("inf")
    for _ in range(TIMES):
        for path in clean:
            shutil.rmtree(path) if os.path.isdir(path) else os.path.exists(path) and os.remove(path)
        begin = children_s()
        subprocess.run(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True)
        best = min(best, children_s() - begin)
    return best


def own(work):
    begin = time.process_time()
    work()
    return time.process_time() - begin


def row(name, rate, unit, asked=None):
    verdict = f"{asked:10g}  {'met' if rate >= asked else 'NOT MET'}" if asked else ""
    print(f"{name:44} {rate:10.3g} {unit:12}{verdict}")


def peer(module, name, work, amount, unit):
    try:
        seconds = own(work)
    except ImportError:
        print(f"  peer: {module} is not installed")
    else:
        row(f"  peer: {name}", amount / seconds, unit)


def write_candump(path):
    """The drop's frames over and over, each time a minute later, under one number more."""
    with open(LOG, encoding="ascii") as file:
        frames = [re.match(r"\((\d+\.\d+)\)(.*)", line) for line in file if line[0] == "("]
    with open(path, "w", encoding="ascii") as file:
        for copy in range(COPIES):
            file.writelines(f"({float(frame[1]) + 60 * copy:.6f}){frame[2]}\n" for frame in frames)
    return COPIES * len(frames)


def write_lcm(folder, path, copies):
    subprocess.run([PROGRAM, "convert", LOG, os.path.join(folder, "one.lcm")], check=True, stdout=subprocess.DEVNULL)
    with open(os.path.join(folder, "one.lcm"), "rb") as file:
        drop = file.read()
    with open(path, "wb") as file:
        for _ in range(copies):
            file.write(drop)
    return len(drop) * copies / 1e6


def write_text(path):
    with open(path, "w", encoding="ascii") as file:
        file.write("time_s,fixture_g,board_g\n")
        for k in range(400000):
            file.write(f"{k * 1e-5:.5f},{500 * (2000 < k < 2100) + (k * 7919 % 1000) / 997:.15g},{(k * 104729 % 1000) / 991:.15g}\n")
    return os.path.getsize(path) / 1e6


def read_candump(path):
    from can.io import CanutilsLogReader

    for _ in CanutilsLogReader(path):
        pass


def read_lcm(path):
    from lcm import EventLog

    for _ in EventLog(path):
        pass


def read_text(path):
    import pandas

    pandas.read_csv(path)


def main(folder):
    start = run(PROGRAM, "--version")

    def taken(*words, **more):
        return max(run(*words, **more) - start, 1e-6)

    log, lcm, text, out = (os.path.join(folder, name) for name in ("log.log", "log.lcm", "text.csv", "out"))
    frames, lcm_mb, text_mb = write_candump(log), write_lcm(folder, lcm, 400), write_text(text)
    print(f"{'processor time, one core':44} {'rate':>10} {'':12}{'asked for':>10}")
    row("candump text to one of its drops", frames / taken(PROGRAM, "analyze", log, "--drop", "3", "--json", clean=[log + ".index"]) / 1e6, "M frames/s", 6)
    peer("python3-can", "python3-can", lambda: read_candump(log), frames / 1e6, "M frames/s")
    row("LCM log of drops, listed", lcm_mb / taken(PROGRAM, "analyze", lcm, "--list", clean=[lcm + ".index"]) / 1e3, "GB/s", 1)
    row("  by its index", lcm_mb / taken(PROGRAM, "analyze", lcm, "--list") / 1e3, "GB/s", 3)
    peer("python3-lcm", "lcm.EventLog", lambda: read_lcm(lcm), lcm_mb / 1e3, "GB/s")
    row("delimited text, 15 digits, analysed", text_mb / taken(PROGRAM, "analyze", "--columns", "time:s,a:g,b:g", text, "--json"), "MB/s", 300)
    peer("python3-pandas", "pandas.read_csv, read only", lambda: read_text(text), text_mb, "MB/s")
    row("batch of LCM drops, all of it", 400 / taken(PROGRAM, "batch", lcm, "--out", out, "-j", "1", clean=[out]), "drops/s", 1000)
    bench = (BENCH, "--scene", "common/scenes/geometry-2A.ini", "--operate", "--quiet", "--drops", "10")
    row("simulated drops, the firmware a process", 10 / run(*bench), "drops/s")
    row("  the firmware inside", 10 / run(*bench, "--inside"), "drops/s")
    row("  and the frame lifted after 0.1 s", 10 / run(*bench, "--inside", "--lift-after", "100"), "drops/s", 100)
    subprocess.run([PROGRAM, "analyze", text, "--columns", "time:s,a:g,b:g"], stdout=subprocess.DEVNULL, check=True)
    print(f"{'largest resident size of any of these':44} {resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024:10.3g} MB")


with tempfile.TemporaryDirectory(prefix="droptower-bench-") as place:
    main(place)
