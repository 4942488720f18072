"""A sweep on two worker processes of Dask: the same bits, also when one of them is killed in the middle."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from mgdd.engine import Cylinder, OperatingPoint
from mgdd.sweep import sweep

pytestmark = pytest.mark.slow

distributed = pytest.importorskip("distributed")
GRID = {
    "speed_rpm": np.linspace(1000.0, 3000.0, 200),
    "soc_cad": np.linspace(-20.0, 5.0, 101),
    "fuel_mg": np.linspace(9.0, 22.0, 20),
}


@pytest.fixture
def client() -> Iterator[Any]:
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        distributed.Client(cluster) as made,
    ):
        yield made


@pytest.mark.filterwarnings("ignore")  # of a worker that is killed
@pytest.mark.parametrize("kill", [False, True], ids=["whole", "one killed"])
def test_the_dataset_is_the_same(client: Any, kill: bool) -> None:
    seen: list[int] = []
    workers = list(client.run(os.getpid).values())
    assert len(set(workers)) == 2

    def progress(done: int, n: int) -> None:
        if kill and not seen:
            os.kill(workers[0], signal.SIGKILL)
        seen.append(done)
        assert done <= n == 404_000

    table = sweep(Cylinder(), OperatingPoint(), GRID, executor=client.get_executor(), progress=progress)
    assert seen[-1] == 404_000
    assert table.identical(sweep(Cylinder(), OperatingPoint(), GRID, workers=1))
