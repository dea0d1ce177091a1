#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""droptower_example.py drop.json drop.csv: a result and its samples, as `droptower run` writes them."""
import json
import sys

import pandas

with open(sys.argv[1]) as file:
    result = json.loads(file.readline())  # one object a line
samples = pandas.read_csv(sys.argv[2])  # a row an instant; empty where a channel has no sample then

print("dropped", result["origin"]["date"], "by", result["origin"]["operator"])
for channel in result["channels"]:
    column = samples[channel["name"] + "_g"].dropna()
    print(f"{channel['name']} peak {channel['peak']['value_g']:.3f} g, {len(column)} samples,"
          f" from {column.min():.5f} to {column.max():.5f} g")
