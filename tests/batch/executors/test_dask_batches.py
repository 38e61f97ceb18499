"""How clouds are dealt out to the workers of a cluster: how many at a time, and who is to blame for a dead one."""

from __future__ import annotations

import pytest

pytest.importorskip("distributed")

from dlogen.batch.executors import dask as cluster
from dlogen.batch.executors.dask import BATCH_CLOUDS, _Batches
from dlogen.batch.executors.dask_worker import Reply
from dlogen.batch.job import Outcome, Task


class TestBatches:
    @staticmethod
    def of(count: int, size: int = 0) -> _Batches:
        return _Batches((Task("x", str(index), content=b"0" * size) for index in range(count)), count)

    @staticmethod
    def reply(batch: list[Task], each: float, done: int | None = None) -> Reply:
        done = len(batch) if done is None else done
        return Reply("", tuple(Outcome(task.key) for task in batch[:done]), each * done)

    def test_few_first_many_later_few_at_the_end(self) -> None:
        batches = self.of(10_000)
        sizes = []
        while batch := batches.next(4, 0):
            sizes.append(len(batch))
            batches.ended(batch, self.reply(batch, 0.001))
        assert sum(sizes) == 10_000
        assert sizes[0] == 1
        assert max(sizes) == sizes[1] == BATCH_CLOUDS
        assert sizes[-4:] == [1, 1, 1, 1]
        assert batches.is_empty()

    def test_slow_clouds_go_in_small_batches(self) -> None:
        batches = self.of(1000)
        batches.ended(batches.next(4, 0), self.reply([Task("x", "x")], 1.0))
        assert len(batches.next(4, 0)) == cluster.BATCH_SECONDS

    def test_large_clouds_go_in_small_batches(self) -> None:
        batches = self.of(1000, cluster.BATCH_BYTES // 4)
        batches.ended(batches.next(4, 0), self.reply([Task("x", "x")], 0.001))
        assert len(batches.next(4, 0)) == 4

    def test_no_vacancies(self) -> None:
        assert self.of(3).next(0, 8) == []

    def test_what_was_not_begun_comes_again(self) -> None:
        batches = self.of(8)
        batches.ended(batches.next(1, 0), self.reply([Task("x", "x")], 0.001))
        batch = batches.next(1, 0)
        assert len(batch) == 7
        batches.ended(batch, self.reply(batch, 0.001, done=3))
        assert batches.next(1, 0) == batch[3:]

    def test_who_is_to_blame_is_found_out_alone(self) -> None:
        batches = self.of(8)
        batches.ended(batches.next(1, 0), self.reply([Task("x", "x")], 0.001))
        assert list(batches.died(batches.next(2, 0))) == []
        one, two = batches.next(2, 0), batches.next(1, 1)
        assert (len(one), len(two)) == (1, 1)
        # Next to each other in a worker that died: either may have done it.
        assert list(batches.died(one)) == list(batches.died(two)) == []
        while (rest := batches.next(2, 1)) and rest not in (one, two):
            batches.ended(rest, self.reply(rest, 0.001))
        assert batches.next(2, 1) == []
        assert batches.next(2, 0) == one
        batches.ended(one, self.reply(one, 0.001))
        assert batches.next(2, 0) == two
        [outcome] = batches.died(two)
        assert outcome.key == two[0].key
        assert outcome.failure is not None
        assert outcome.failure.code == "worker-died"
        assert batches.is_empty()
