"""Times of functions that are compared."""

import time

import numpy as np


def least(*functions, rounds, clock=time.process_time):
    """The least time of each function [s]; the functions take turns, so that load falls on all of them."""
    times = np.full((rounds, len(functions)), np.inf)
    for row in times:
        for k, function in enumerate(functions):
            start = clock()
            function()
            row[k] = clock() - start
    return times.min(axis=0)
