"""How many threads BLAS uses."""

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from workbench import WorkbenchError
from workbench.threads import blas_libraries, limited_threads, thread_count


def counts() -> set[int]:
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


@pytest.mark.parametrize(("said", "threads"), [(None, 1), ("2", 2)])
def test_thread_limit_holds_inside_and_is_lifted(
    monkeypatch: pytest.MonkeyPatch, said: str | None, threads: int
) -> None:
    monkeypatch.delenv("WORKBENCH_THREADS", raising=False)
    if said:
        monkeypatch.setenv("WORKBENCH_THREADS", said)
    assert blas_libraries()  # they are loaded now, if they were not
    with threadpool_limits(limits=2, user_api="blas"):
        before = counts()
        with limited_threads():
            assert counts() <= {threads}
        assert counts() == before


@pytest.mark.parametrize("said", ["0", "many", "-1", "1.5"])
def test_thread_counts_that_are_none_are_refused(
    monkeypatch: pytest.MonkeyPatch, said: str
) -> None:
    monkeypatch.setenv("WORKBENCH_THREADS", said)
    with pytest.raises(WorkbenchError, match="1 or more"):
        thread_count()


def test_libraries_are_named() -> None:
    assert all("threads" in text for text in blas_libraries())
