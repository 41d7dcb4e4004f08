"""The same campaign by Dask: one worker in this process, on loopback."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from app.campaign.ledger import WHOLE, results_in
from app.campaign.running import CampaignWish, run_campaign
from app.campaign.scheduling import CampaignStopped
from app.campaign.workers.cluster import ClusterProblem, open_cluster
from app.campaign.workers.stub import StubPlan, play_stub
from app.measure.bench.campaign import SPEC, Unwatched

pytestmark = pytest.mark.filterwarnings("ignore")  # of Dask's own


@pytest.fixture
def scheduler() -> Iterator[str]:
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, host="tcp://127.0.0.1"
    ) as cluster:
        yield cluster.scheduler_address


def test_a_clusters_workers_play_the_same(scheduler: str, tmp_path: Path) -> None:
    plan = StubPlan(marks=tmp_path, full=(2,))
    wish = CampaignWish(5, tmp_path / "campaign", scheduler=scheduler, play=partial(play_stub, plan), pause=0.0)
    assert run_campaign(SPEC, wish, Unwatched()).holds
    assert sorted(one.game.index for one in results_in(tmp_path / "campaign" / WHOLE.ledger)) == [0, 1, 2, 3, 4]


def test_a_scheduler_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("app.campaign.workers.cluster.CONNECT", 0.5)
    with (
        pytest.raises(ClusterProblem, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"),
        open_cluster("tcp://127.0.0.1:9"),
    ):
        pass


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("ucx://127.0.0.1:8786", "which is no address: name one such as tcp://host:8786"),
        ("tcp://127.0.0.1", "which is no address: name one such as tcp://host:8786"),
        ("tcp://127.0.0.1:99999", "which is no address: name one such as tcp://host:8786"),
        ("tls://127.0.0.1:8786", "Dask's configuration names no certificates: set distributed.comm.tls.ca-file and"),
    ],
)
def test_an_address_that_dask_cannot_use_is_said(address: str, said: str) -> None:
    pytest.importorskip("distributed")
    with pytest.raises(ClusterProblem) as caught, open_cluster(address):
        pass
    assert str(caught.value).startswith(f"--scheduler is '{address}', ")
    assert said in str(caught.value)


def test_a_scheduler_that_ends_while_it_has_no_worker_yet_is_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr("app.campaign.running.TELL_EVERY", 0.01)
    told = list[str]()
    with distributed.LocalCluster(
        n_workers=0, processes=False, dashboard_address=None, host="tcp://127.0.0.1"
    ) as cluster:

        class Shown(Unwatched):
            def waiting(self, reason: str) -> None:
                told.append(reason)
                if len(told) == 3:
                    cluster.close()

        address = cluster.scheduler_address
        wish = CampaignWish(1, tmp_path / "campaign", scheduler=address, play=partial(play_stub, StubPlan()))
        with pytest.raises(CampaignStopped, match="the scheduler is gone"):
            run_campaign(SPEC, wish, Shown())
    assert set(told[:3]) == {
        "no worker is there yet, or its environment lacks this program: "
        f"start some with 'dask worker {address}' where this program is installed"
    }
