"""`workbench coregister` on 200 scans: its time, its memory, and the same bits after three kills.

python -m benchmarks.many_scans FOLDER

The scans, of ten people with twelve holes in each scan, are simulated as in
`benchmarks.coregistration`. FOLDER is filled as `workbench register` fills it, with each fit 0.03
rad and 10 mm from the truth. The command then runs with two workers: undisturbed, while its
checkpoint of the first round is put aside, and for one round in which it is killed three times.
Numbers go to `results/many-scans.json`.
"""

import argparse
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.coregistration import SETS
from benchmarks.keeping import keep
from benchmarks.machine import description
from examples.studies.simulated_scans import START, ScannedSet, scanned_set
from workbench import load_body
from workbench.bodies.files.saving import save_body
from workbench.registration.coregistration.coregistering import FILE
from workbench.registration.coregistration.folder import BODY, SCAN
from workbench.reports.registration import ARRAYS, points, subjects_csv
from workbench.training.folder import TABLE, Row
from workbench.writing import write_arrays

RESULTS = Path(__file__).parent / "results" / "many-scans.json"
SEED, PEOPLE, SCANS, KILLS, WORKERS = 300, 10, 200, 3, 2
FIRST_ROUND = 3  # blocks: registrations, model, registrations
EVERY = 0.2  # s, between two looks at the processes


def prepare(place: Path, given: ScannedSet) -> None:
    """A folder of registered scans, as `workbench register` writes it, of fits that are near."""
    body, rows = load_body(START), []
    place.mkdir(parents=True)
    for j, start in enumerate(given.starts):
        folder = place / f"scan {j:03}"
        folder.mkdir()
        write_arrays(folder / SCAN, points(given.scans.read(j)))
        write_arrays(folder / ARRAYS, {"vertices": body.vertices(**start), **start})
        rows.append(Row(f"{folder.name}/{ARRAYS}", f"person {given.subject[j]}"))
    (place / TABLE).write_text(subjects_csv(rows))
    save_body(body, place / BODY)


def command(place: Path, out: Path) -> list[str]:
    """What a user types."""
    given = ["coregister", str(place), "--workers", str(WORKERS), "--out", str(out)]
    return [sys.executable, "-m", "workbench", *given]


def memory(pid: int) -> float:
    """GB that a process and its children hold, each page counted once (PSS)."""
    total = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            group = os.getpgid(int(process.name))
            if group == pid:
                text = (process / "smaps_rollup").read_text()
                total += int(text.partition("\nPss:")[2].split()[0])
        except (OSError, IndexError):
            continue  # it has ended
    return total * 1024 / 1e9


def undisturbed(place: Path, out: Path, aside: Path) -> dict[str, float]:
    """Seconds, CPU seconds and the largest memory; the checkpoint of round one goes to `aside`."""
    before, began = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    run = subprocess.Popen(command(place, out), start_new_session=True)
    most, checkpoint = 0.0, out / f"coregister-{place.name}" / FILE
    while run.poll() is None:
        most = max(most, memory(run.pid))
        if not aside.exists() and blocks(checkpoint) == FIRST_ROUND:
            shutil.copy(checkpoint, aside)
        time.sleep(2)
    if run.returncode:
        raise SystemExit(f"workbench coregister ended with {run.returncode}")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"seconds": time.perf_counter() - began, "cpu_seconds": cpu, "memory_gb": most}


def blocks(checkpoint: Path) -> int:
    """How many blocks have run, by a checkpoint; 0 if there is none."""
    if not checkpoint.exists():
        return 0
    with np.load(checkpoint) as found:
        return int(str(found["facts"]).count('"block"'))


def killed(place: Path, out: Path) -> int:
    """Run until the first round is there, killed `KILLS` times at random; how often it was."""
    checkpoint = out / f"coregister-{place.name}" / FILE
    rng, kills = np.random.default_rng(SEED), 0
    while blocks(checkpoint) < FIRST_ROUND:
        run = subprocess.Popen(command(place, out), start_new_session=True)
        had = blocks(checkpoint)
        if kills < KILLS:
            while blocks(checkpoint) == had and kills:
                time.sleep(EVERY)  # from the second kill on, after a block that it ended
            time.sleep(rng.uniform(20, 60))
            kills += 1
        else:
            while blocks(checkpoint) < FIRST_ROUND:
                time.sleep(EVERY)
        os.killpg(run.pid, signal.SIGKILL)
        run.wait()
    return kills


def same(one: Path, other: Path) -> bool:
    """Whether two checkpoints hold the same numbers, but for the times in their logs."""
    with np.load(one) as a, np.load(other) as b:
        names = set(a.files) - {"facts"}
        return names == set(b.files) - {"facts"} and all(
            a[name].tobytes() == b[name].tobytes() for name in names
        )


def main() -> None:
    """Simulate, run, kill, compare, and keep the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    place = parser.parse_args().folder / "scans"
    if not place.exists():
        prepare(place, scanned_set(SEED, PEOPLE, SCANS, *SETS["holes"]))
    aside = place.parent / "first round.npz"
    found: dict[str, Any] = {"scans": SCANS, "people": PEOPLE, "workers": WORKERS}
    found |= undisturbed(place, place.parent / "undisturbed", aside)
    print(found, flush=True)
    found["kills"] = killed(place, place.parent / "killed")
    checkpoint = place.parent / "killed" / f"coregister-{place.name}" / FILE
    found["same_bits"] = same(aside, checkpoint)
    found["machine"] = description()
    keep(RESULTS, found, 4)
    print(found)


if __name__ == "__main__":
    main()
