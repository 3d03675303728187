"""A dask cluster gives the rows that one process gives, whatever dies."""

import gc
import os
import signal
import time

import pytest
from helpers.studies import plain, short

from sim.scenario.errors import InputError
from sim.study.cluster import connected
from sim.study.engine import complete
from sim.study.store import Store, read_rows
from sim.study.trial import fly

distributed = pytest.importorskip("distributed")


def test_a_worker_killed_in_mid_study_loses_no_trial_and_changes_no_row(tmp_path):
    tasks = short(["hover", "greedy"], "0-5")
    killed = []
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": None, "silence_logs": 50}
    with distributed.LocalCluster(**options) as local, connected(local.scheduler_address) as cluster:

        def kill(task, row, fresh):
            if not killed:
                killed.append(next(iter(local.workers.values())).pid)
                os.kill(killed[0], signal.SIGKILL)

        with Store.opened(tmp_path, "short") as store:
            rows = complete(tasks, store, cluster, heard=kill)
    assert killed
    assert list(map(plain, rows)) == [plain(fly(task).row) for task in tasks]
    assert len(read_rows(tmp_path)) == len(tasks)


def test_an_address_that_does_not_answer_is_one_line(monkeypatch, capfd):
    monkeypatch.setattr("sim.study.cluster._CONNECT", 0.5)
    start = time.monotonic()
    for address in ("tcp://127.0.0.1:9", "nonsense", "nonsense://x", "127.0.0.1:notaport"):
        with pytest.raises(InputError, match=f"--dask: '{address}' does not answer") as raised, connected(address):
            pass
        assert "\n" not in str(raised.value)
    gc.collect()
    assert capfd.readouterr() == ("", "") and time.monotonic() - start < 10
