"""Rows of a study that was never flown."""

import numpy as np

from sim.study.trials import TrialRow

SETTINGS = {"trees.density": "75", "sensing.mode": "ideal", "duration": "10"}


def row(planner="sma-nbo", seed=0, factors=(), metrics=None, **fields):
    """A trial that is done; its OSPA is its mean at all of three scans, unless told."""
    metrics = {"ospa.mean_m": 1.0} if metrics is None else metrics
    ospa = np.full(3, metrics.get("ospa.mean_m", np.nan), dtype=np.float32)
    whole = {"study": "tried", "scenario": "forest", "version": "0.1.0", "status": "done", "ospa": ospa}
    whole |= {"times": np.arange(len(fields.get("ospa", ospa))) / 5, "settings": SETTINGS}
    return TrialRow(planner=planner, seed=seed, factors=factors, metrics=metrics, **{**whole, **fields})


def failed(planner="sma-nbo", seed=0, factors=(), error="ValueError: no place for the forest", **fields):
    """A trial that failed."""
    empty = {"metrics": {}, "ospa": np.zeros(0, dtype=np.float32), "times": np.zeros(0)}
    return row(planner, seed, factors, status="failed", error=error, **empty, **fields)


def study(planners=("sma-nbo", "greedy", "hover"), densities=("15", "75"), seeds=6, scans=26):
    """Done trials of every planner, density and seed, the later planners worse by chance and on average."""
    rng = np.random.default_rng(4)
    rows = []
    for density in densities:
        for i, planner in enumerate(planners):
            for seed in range(seeds):
                ospa = (rng.gamma(2.0, 0.15 * (1 + i), scans) + 0.1).astype(np.float32)
                metrics = {
                    "ospa.mean_m": float(ospa.mean()),
                    "ospa.median_m": float(np.median(ospa)),
                    "ospa.share_under_1m": float(np.mean(ospa < 1)),
                    "planning_s_per_decision": float(rng.gamma(3.0, 0.01 * (i + 1))),
                    "real_time_factor": 10.0 - i,
                }
                factors = (("lambda", density), ("R", "5"))
                rows.append(row(planner, seed, factors, metrics, ospa=ospa))
    return rows
