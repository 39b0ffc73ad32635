"""One Dask cluster for all tests that need workers: to start one takes as long as all of them."""

import distributed
import pytest


@pytest.fixture(scope="session")
def client(tmp_path_factory):
    """Two workers with one thread each, which see the modules of the tests."""
    folder = str(tmp_path_factory.mktemp("dask"))
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address="127.0.0.1:0", local_directory=folder
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client
