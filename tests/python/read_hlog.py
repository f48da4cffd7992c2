"""Reads an HdrHistogram log with the PyPI package hdrhistogram, prints count and largest value of each tag as JSON."""

import json
import sys

from hdrh.histogram import HdrHistogram
from hdrh.log import HistogramLogReader

BOUND_NS = 60_000_000_000

sums = {}
reader = HistogramLogReader(sys.argv[1], HdrHistogram(1, BOUND_NS, 3))
while (interval := reader.get_next_interval_histogram()) is not None:
    tag = interval.get_tag()
    if tag not in sums:
        sums[tag] = HdrHistogram(1, BOUND_NS, 3)
    sums[tag].add(interval)
figures = {
    tag: {"count": all_of_it.get_total_count(), "max": all_of_it.get_max_value()}
    for tag, all_of_it in sums.items()
}
json.dump(figures, sys.stdout, indent=1)
