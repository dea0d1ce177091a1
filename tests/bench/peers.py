# SPDX-License-Identifier: GPL-3.0-or-later
#
# The decay fit of make bench by scipy, on a decay of the same size. Called when python3-scipy is installed.
import time

import numpy
from scipy.optimize import curve_fit


def decay(t, offset, a, w, cosine, sine):
    return offset + numpy.exp(-a * t) * (cosine * numpy.cos(w * t) + sine * numpy.sin(w * t))


t = numpy.arange(280) / 7000
truth = (0, 81.5, 2 * numpy.pi * 128.4, 240, 200)
data = decay(t, *truth) + numpy.random.default_rng(1).normal(0, 1, t.size)
spans = []
for _ in range(200):
    begin = time.perf_counter()
    curve_fit(decay, t, data, p0=(0, 75, 2 * numpy.pi * 131, 250, 100))
    spans.append((time.perf_counter() - begin) * 1e6)
spans.sort()
print(f'{"peer: decay of 5 unknowns, scipy curve_fit":44} {spans[100]:10.2f} {spans[0]:10.2f}')
