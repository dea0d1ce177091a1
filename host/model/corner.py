#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""
corner.py FOLDER [JOBS]: the contact table by finite elements, host/model/corner.def on standard output.

A right-angled edge of radius r dents a mat of thickness 1 that holds to a rigid floor; plane strain, large
displacements, neo-Hookean rubber of Young's modulus 1, Poisson's ratio 0.49; the edge is rigid, smooth, and moves
straight down. CalculiX (ccx) solves each case on two meshes; what it has solved stays in FOLDER and is not solved
again. Lengths in thicknesses, forces per length of the edge in E* = E/(1 - poisson^2) thicknesses.

It stands beside the model because its table is the model's; nothing calls it but `make contact-table`.
"""
import datetime
import math
import os
import subprocess
import sys
from multiprocessing.pool import ThreadPool

DEPTH, STEPS = 0.4, 6        # deepest dent, and how many on the way
ANGLES, RADII = (10, 20, 45), (0.25, 0.7, 2.0)
APART = ((25, 1.0), (32, 0.4), (14, 1.4))   # not in the grid: what interpolation is held against
MESHES = (0.2, 0.13)         # side of an element under the edge
POISSON, PENALTY = 0.49, 500.0              # the penalty's stiffness: E over thickness
PATIENCE_S = 1800            # for one case
STUDY = (25, 1.5)
VARIANTS = {'as it is': {}, 'friction 0.8': {'friction': 0.8}, 'floor without friction': {'bonded': False},
            'poisson 0.499': {'poisson': 0.499}, 'penalty 250': {'penalty': 250.0}, 'mat 3 wide': {'end': 3.0}}


def graded(start, stop, end, side, growth=1.25):
    """Places of element edges: even from start to stop, growing to -end and end."""
    count = max(1, round((stop - start) / side))
    at = [start + (stop - start) * i / count for i in range(count + 1)]
    step = side
    while at[-1] < end:
        step *= growth
        at.append(at[-1] + step)
    step = side
    while at[0] > -end:
        step *= growth
        at.insert(0, at[0] - step)
    return at


def layers(side, growth=1.12):
    """The same from the floor at -1 to the top at 0."""
    at, step = [0.0], side
    while at[-1] - step * 1.3 > -1:
        at.append(at[-1] - step)
        step *= growth
    return (at + [-1.0])[::-1]


def profile(slopes, radius, top):
    """Points (x, y, slope) of the edge's outline from left to right, lowest at (0, 0); slopes of both faces."""
    low, high = -slopes[0], slopes[1]
    count = max(12, int((high - low) * 90 / math.pi))
    turns = [low + (high - low) * i / count for i in range(count + 1)]
    arc = [(radius * math.sin(p), radius - radius * math.cos(p), p) for p in turns]

    def face(point, sign):
        x, y, p = point
        length = (top - y) / abs(math.sin(p)) if y < top else 0.2
        count = max(2, int(length / 0.1))
        return [(x + sign * math.cos(p) * length * i / count, y + abs(math.sin(p)) * length * i / count, p)
                for i in range(1, count + 1)]

    return face(arc[0], -1)[::-1] + arc + face(arc[-1], 1)


def rows(ids, size=10):
    return [','.join(map(str, ids[i:i + size])) for i in range(0, len(ids), size)]


def mat(out, xs, ys, pressed):
    """Nodes and eight-node elements of the mat; node numbers by place, and how many of both."""
    node, tops, element = {}, [], 0
    out.append('*NODE')
    for j in range(2 * len(ys) - 1):
        for i in range(2 * len(xs) - 1):
            if i % 2 and j % 2:
                continue
            node[i, j] = len(node) + 1
            x = (xs[i // 2] + xs[(i + 1) // 2]) / 2
            y = (ys[j // 2] + ys[(j + 1) // 2]) / 2
            out.append(f'{node[i, j]},{x:.9g},{y:.9g},0')
    out.append('*ELEMENT, TYPE=CPE8R, ELSET=MAT')
    for b in range(0, 2 * len(ys) - 2, 2):
        for a in range(0, 2 * len(xs) - 2, 2):
            element += 1
            ids = [node[a, b], node[a + 2, b], node[a + 2, b + 2], node[a, b + 2],
                   node[a + 1, b], node[a + 2, b + 1], node[a + 1, b + 2], node[a, b + 1]]
            out.append(','.join(map(str, [element] + ids)))
            if b == 2 * len(ys) - 4 and pressed[0] < xs[a // 2] < pressed[1]:
                tops.append(element)
    out += ['*ELSET, ELSET=TOP'] + rows(tops)
    return node, element


def edge(out, outline, radius, node, element):
    """A strip of four-node elements along the outline, every node of which is led."""
    inner, first, count = min(0.05, radius / 2), len(node) + 1, len(outline)
    out.append('*NODE, NSET=EDGE')
    for k, (x, y, p) in enumerate(outline):
        out.append(f'{first + k},{x:.9g},{y + 1e-9:.9g},0')
        out.append(f'{first + count + k},{x - inner * math.sin(p):.9g},{y + inner * math.cos(p):.9g},0')
    out.append('*ELEMENT, TYPE=CPE4, ELSET=STRIP')
    for k in range(count - 1):
        a = first + k
        out.append(f'{element + 1 + k},{a},{a + 1},{a + count + 1},{a + count}')


def deck(slopes, radius, side, depth=DEPTH, steps=STEPS, friction=0.0, bonded=True, poisson=POISSON,
         penalty=PENALTY, end=4.0):
    outline = profile(slopes, radius, depth + 0.6)
    touched = [x for x, y, _ in outline if y <= depth * 1.15]
    xs = graded(min(touched) - side / 2, max(touched) + side / 2, end, side)
    ys = layers(side)
    out = []
    node, element = mat(out, xs, ys, (min(touched) - 0.8, max(touched) + 0.8))
    edge(out, outline, radius, node, element)
    last = 2 * len(xs) - 2
    out += ['*NSET, NSET=FLOOR'] + rows([n for (i, j), n in node.items() if j == 0])
    out += ['*NSET, NSET=ENDS'] + rows([n for (i, j), n in node.items() if i in (0, last)])
    shear, bulk = 0.5 / (1 + poisson), 1 / (3 * (1 - 2 * poisson))
    out += ['*SURFACE, NAME=MATTOP', 'TOP,S3', '*SURFACE, NAME=FACES', 'STRIP,S1',
            '*MATERIAL, NAME=RUBBER', '*HYPERELASTIC, NEO HOOKE', f'{shear / 2:.9g},{2 / bulk:.9g}',
            '*MATERIAL, NAME=LED', '*ELASTIC', '1,0.3',
            '*SOLID SECTION, ELSET=MAT, MATERIAL=RUBBER', '1', '*SOLID SECTION, ELSET=STRIP, MATERIAL=LED', '1',
            '*SURFACE INTERACTION, NAME=TOUCH', '*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR', f'{penalty:g}']
    out += ['*FRICTION', f'{friction:g},{penalty / 10:g}'] if friction else []
    out += ['*CONTACT PAIR, INTERACTION=TOUCH, TYPE=SURFACE TO SURFACE', 'MATTOP,FACES',
            '*BOUNDARY', 'FLOOR,2,2', 'EDGE,1,1', 'FLOOR,1,1' if bonded else 'ENDS,1,1',
            '*TIME POINTS, NAME=POINTS, GENERATE', f'{1 / steps:.9g},1,{1 / steps:.9g}',
            '*STEP, NLGEOM, INC=200', '*STATIC', f'{0.2 / steps:g},1,1e-3,{1 / steps:g}',
            '*BOUNDARY', f'EDGE,2,2,{-depth:.9g}',
            '*NODE PRINT, NSET=EDGE, TOTALS=ONLY, TIME POINTS=POINTS', 'RF', '*END STEP']
    return '\n'.join(out) + '\n'


def solve(folder, slopes, radius, side, **how):
    """Forces (down, across) over E* at the steps of depth, and how many of them were solved."""
    name = '-'.join(f'{v:.4g}' for v in (*map(math.degrees, slopes), radius, side)) + ''.join(
        f'-{k}-{v}' for k, v in how.items())
    path, steps = os.path.join(folder, name.replace('.', '_')), how.get('steps', STEPS)
    if not os.path.exists(path + '.done'):
        with open(path + '.inp', 'w') as file:
            file.write(deck(slopes, radius, side, **how))
        with open(path + '.log', 'w') as log:
            try:
                subprocess.run(['ccx', '-i', os.path.basename(path)], cwd=folder, stdout=log, stderr=log, check=False,
                               env=dict(os.environ, OMP_NUM_THREADS='1'), timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                pass   # what it wrote so far counts
        os.rename(path + '.dat', path + '.done')
    with open(path + '.done') as file:
        lines = [line.split() for line in file if line.strip()]
    if not any('total' in line for line in lines):
        return [(math.nan, math.nan)] * steps, 0
    plane = 1 / (1 - how.get('poisson', POISSON) ** 2)
    forces = [(math.nan, math.nan)] * steps
    for head, line in zip(lines, lines[1:]):
        if head[0] == 'total':
            forces[round(float(head[-1]) * steps) - 1] = (-float(line[1]) / plane, float(line[0]) / plane)
    solved = sum(not math.isnan(f[0]) for f in forces)
    for k in range(2, steps):   # where ccx gave up, as the power of the last two went on
        if math.isnan(forces[k][0]):
            power = math.log(forces[k - 1][0] / forces[k - 2][0]) / math.log(k / (k - 1))
            forces[k] = tuple(f * ((k + 1) / k) ** power for f in forces[k - 1])
    return forces, solved


def right_angle(angle):
    return math.radians(90 - angle), math.radians(angle)


def kernel(poisson):
    """a0, a1 of a bonded layer's surface displacement under a line load, 2/(pi E*) (-ln x + a0 + a1 x^2)."""
    k, step = 3 - 4 * poisson, 1e-3
    a0 = a1 = 0.0
    for i in range(40000):
        s = (i + 0.5) * step
        decay = math.exp(-2 * s)   # numerator and denominator over exp(2 s)/2
        load = (2 * k * (1 - decay ** 2) - 8 * s * decay) / (
            2 * k * (1 + decay ** 2) + 2 * (1 + k * k + 4 * s * s) * decay)
        a0 += (load - 1 + math.exp(-s)) / s * step
        a1 += -(load - 1) * s / 2 * step
    return a0, a1


def line_contact(depth, radius):
    """Hertz' line contact on a bonded layer, small strains: force over E* at this depth."""
    a0, a1 = kernel(POISSON)
    low, high = 1e-6, 2.0
    for _ in range(60):
        a = math.sqrt(low * high)
        load = math.pi / (4 * radius) / (1 / a ** 2 - a1)
        if 2 * load / math.pi * (math.log(2 / a) + 0.5 + a0 + a1 * a * a / 4) < depth:
            low = a
        else:
            high = a
    return load


def blunt_wedge(depth, slope):
    """A blunt wedge on it: load E* a slope, pressure E* slope/pi acosh(a/x)."""
    a0, a1 = kernel(POISSON)
    n = 20000
    us = [(i + 0.5) / n for i in range(n)]
    mean = 2 / math.pi / n * sum(math.acosh(1 / u) * -math.log(u) for u in us)
    square = 2 / math.pi / n * sum(math.acosh(1 / u) * u * u for u in us)
    low, high = 1e-6, 1.0
    for _ in range(60):
        a = math.sqrt(low * high)
        load = a * slope
        if 2 * load / math.pi * (-math.log(a) + mean + a0 + a1 * a * a * square) < depth:
            low = a
        else:
            high = a
    return load


def closed_forms(folder):
    """(what, depth, finite elements, closed form)"""
    found = []
    how = {'depth': 0.03, 'steps': 2}
    slope = math.radians(8)
    for what, slopes, radius, law in (
            ('line contact, r 1', (0.5, 0.5), 1.0, lambda d: line_contact(d, 1.0)),
            ('wedge of 8 deg', (slope, slope), 0.05, lambda d: blunt_wedge(d, math.tan(slope)))):
        for k, force in enumerate(solve(folder, slopes, radius, 0.05, **how)[0]):
            depth = 0.03 * (k + 1) / 2
            found.append((what, depth, force[0], law(depth)))
    return found


def table(places, coarse, fine):
    """Of each place the finer mesh, unless ccx gave up on it sooner; where only one went, the meshes' worst."""
    differ = [[abs(c[0] / f[0] - 1) if k < min(a, b) else math.nan for k, (c, f) in enumerate(zip(cs, fs))]
              for (cs, a), (fs, b) in zip(coarse, fine)]
    worst = [max(d[k] for d in differ if not math.isnan(d[k])) for k in range(STEPS)]
    for n, (angle, radius) in enumerate(places):
        kind = 'CORNER_POINT' if n < len(ANGLES) * len(RADII) else 'CORNER_APART'
        taken, solved = fine[n] if fine[n][1] >= coarse[n][1] else coarse[n]
        values = ', '.join(f'{f[0]:.5f}' for f in taken)
        errors = ', '.join(f'{100 * (w if math.isnan(d) else d):.1f}' for d, w in zip(differ[n], worst))
        side = MESHES[1] if taken is fine[n][0] else MESHES[0]
        print(f'{kind}({angle}, {radius}, LIST({values}), LIST({errors})) /* {side}, {solved} solved */')


def main():
    folder, jobs = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else os.cpu_count()
    os.makedirs(folder, exist_ok=True)
    pool = ThreadPool(jobs)
    places = [(a, r) for a in ANGLES for r in RADII] + list(APART)
    coarse, fine = [[pool.apply_async(solve, (folder, right_angle(a), r, side)) for a, r in places]
                    for side in MESHES]
    variants = {name: pool.apply_async(solve, (folder, right_angle(STUDY[0]), STUDY[1], MESHES[0]), how)
                for name, how in VARIANTS.items()}
    closed = pool.apply_async(closed_forms, (folder,))
    version = subprocess.run(['ccx', '-v'], capture_output=True, text=True, check=False).stdout.split()[-1]
    print('/* SPDX-License-Identifier: GPL-3.0-or-later\n *')
    print(f' * Made by `make contact-table` on {datetime.date.today()} with CalculiX {version}; not edited. corner.py')
    print(' * tells what was solved. Force over E* length thickness at depths of 1/15, 2/15 ... 6/15 of the thickness;')
    print(f' * in percent, how far elements of {MESHES[0]} and {MESHES[1]} under the edge are from each other; which were')
    print(' * taken, and how many depths were solved before ccx gave up: the rest goes on as a power.\n *')
    base = variants['as it is'].get()[0]
    print(f' * At {STUDY[0]} deg, radius {STUDY[1]}, elements of {MESHES[0]}, percent of change:')
    for name in list(VARIANTS)[1:]:
        forces, solved = variants[name].get()
        print(f' *   {name:24}', *(f'{100 * (v[0] / b[0] - 1):6.1f}' for v, b in zip(forces[:solved], base)))
    print(' * Force across over force down there:', *(f'{x / y:.3f}' for y, x in base))
    print(' *')
    print(' * Closed forms of small strains (force, closed form):')
    for what, depth, found, law in closed.get():
        print(f' *   {what:18} depth {depth:.3f}: {found:.5f} {law:.5f}')
    print(' */')
    table(places, [c.get() for c in coarse], [f.get() for f in fine])


main()
