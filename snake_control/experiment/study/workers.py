"""Runs trials in parallel: over processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import asyncio
import concurrent.futures
import importlib
import itertools
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from typing import Any

from snake_control.errors import StudyError
from snake_control.experiment.study.trial import Outcome, Trial, run_trial

_ANSWER_S = 5.0
_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


def run_in_processes(trials: Sequence[Trial], workers: int) -> Iterator[tuple[Trial, Outcome]]:
    """Yield trials with their outcomes as they are done.

    Args:
        trials: what to run.
        workers: number of processes, at least 1.
    """
    # The matrices are small and every core has a trial of its own: threads would only wait for
    # each other. Numpy reads this when a new process loads it.
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        pool = concurrent.futures.ProcessPoolExecutor(
            workers,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_prepare_worker,
        )
        try:
            # No more than the workers can take: what waits inside the pool cannot be called off.
            waiting = iter(trials)
            running = {
                pool.submit(run_trial, trial): trial for trial in itertools.islice(waiting, workers)
            }
            while running:
                done, _ = concurrent.futures.wait(
                    running, return_when=concurrent.futures.FIRST_COMPLETED
                )
                for future in done:
                    trial = running.pop(future)
                    for following in itertools.islice(waiting, 1):
                        running[pool.submit(run_trial, following)] = following
                    yield trial, future.result()
        finally:
            pool.shutdown(cancel_futures=True)
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _prepare_worker() -> None:
    # Ctrl-C reaches the whole process group; whoever started the study decides what happens then.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this process with its parent, who may be killed without a chance to say so."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def run_on_dask(trials: Sequence[Trial], scheduler: str) -> Iterator[tuple[Trial, Outcome]]:
    """Yield trials with their outcomes as a Dask cluster finishes them.

    Args:
        trials: what to run; the workers need this package installed.
        scheduler: address, such as ``tcp://host:8786``.

    Raises:
        StudyError: Dask is not installed, or no scheduler answers there.
    """
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError as error:
        raise StudyError(
            "a scheduler was given, but Dask is not installed: pip install dask distributed"
        ) from error
    try:
        # A client that does not reach its scheduler keeps trying when it is closed.
        asyncio.run(_reach(distributed, scheduler))
        client = distributed.Client(scheduler, timeout=_ANSWER_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise StudyError(f"no Dask scheduler answers at {scheduler}: {error}") from error
    with client:
        futures: dict[Any, Trial] = {
            client.submit(run_trial, trial, key=f"snake_control-{trial.key}"): trial
            for trial in trials
        }
        try:
            for future in distributed.as_completed(list(futures), loop=client.loop):
                yield futures[future], future.result()
        finally:
            client.cancel([future for future in futures if not future.done()])


async def _reach(distributed: Any, scheduler: str) -> None:
    """Connect once as a client would.

    Raises:
        OSError, ValueError: nobody who speaks Dask's protocol is there.
    """
    arguments = distributed.Security().get_connection_args("client")
    connection = await distributed.comm.connect(scheduler, timeout=_ANSWER_S, **arguments)
    await connection.close()
