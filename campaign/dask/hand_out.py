"""Hands the parts of a campaign out to a Dask cluster, and merges what comes back.

A task is one part: the worker runs `campaign run --shard PART/PARTS` in a folder of its own and sends the part's bytes back, so
that cluster and driver need no shared disk; what a worker needs is the program and the files that the campaign names, at the same
paths. A part that comes back is written beside its place and renamed. Which runs it holds and what they come to follows from the
campaign alone: a worker that is killed costs time, the scheduler gives its parts to others.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import dask
from distributed import Client, KilledWorker, LocalCluster, as_completed


def do_part(command, part, parts):
    """Runs one part on a worker; its file's bytes."""
    with tempfile.TemporaryDirectory(prefix="airbench-part-") as folder:
        words = [*command, "--out", folder, "--shard", f"{part}/{parts}", "--jobs", "1"]
        done = subprocess.run(words, stdin=subprocess.DEVNULL, capture_output=True, text=True)
        if done.returncode != 0:
            said = done.stderr.strip().splitlines()
            raise RuntimeError(f"part {part}: exit code {done.returncode}: {said[-1] if said else 'nothing said'}")
        return pathlib.Path(folder, "parts", f"{part:06}.csv").read_bytes()


def write_whole(path, content):
    """A file that is there as a whole, or not."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".part-", suffix=".tmp", delete=False) as beside:
        try:
            beside.write(content)
            beside.flush()
            # Made for its owner alone; whoever may read the folder's other files may read it.
            mask = os.umask(0)
            os.umask(mask)
            os.fchmod(beside.fileno(), 0o666 & ~mask)
            os.fsync(beside.fileno())
            os.rename(beside.name, path)
        except BaseException:
            os.unlink(beside.name)
            raise


def arguments():
    parser = argparse.ArgumentParser(prog="scripts/campaign dask", description=__doc__.splitlines()[0])
    parser.add_argument("file", help="the campaign file")
    parser.add_argument("--out", type=pathlib.Path, help="folder of parts and results; default: runs/campaigns/NAME")
    parser.add_argument("--scheduler", help="address of a Dask scheduler, tcp://HOST:8786; default: workers on this machine")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="workers on this machine; default: one a core")
    parser.add_argument("--campaign", default="campaign", help="the program, as workers call it")
    parser.add_argument("--shipped", help="folder with the shipped experiments and programs, as workers call it")
    asked = parser.parse_args()
    asked.out = asked.out or pathlib.Path("runs/campaigns", pathlib.Path(asked.file).stem)
    return asked


def main():
    asked = arguments()
    shipped = ["--shipped", asked.shipped] if asked.shipped else []
    file = os.path.abspath(asked.file)
    plan = subprocess.run([asked.campaign, "plan", file, *shipped, "--json"], stdout=subprocess.PIPE, text=True)
    if plan.returncode != 0:
        return plan.returncode
    plan = json.loads(plan.stdout)
    parts = plan["parts"]
    path = lambda part: asked.out / "parts" / f"{part:06}.csv"
    missing = [part for part in range(parts) if not path(part).exists()]
    print(f"campaign: {plan['runs']} runs in {parts} parts; {len(missing)} parts to do", file=sys.stderr, flush=True)
    # Every task of a worker that dies counts as suspicious, whether it was at work or waiting.
    dask.config.set({"distributed.scheduler.allowed-failures": 20})
    if asked.scheduler:
        cluster, client = None, Client(asked.scheduler)
    else:
        cluster = LocalCluster(n_workers=asked.workers, threads_per_worker=1, dashboard_address=None)
        client = Client(cluster)
    began, printed_s = time.monotonic(), 0.0
    try:
        command = [asked.campaign, "run", file, *shipped]
        tasks = {client.submit(do_part, command, part, parts, pure=False): part for part in missing}
        for done, task in enumerate(as_completed(tasks), start=1):
            write_whole(path(tasks[task]), task.result())
            task.release()
            passed = time.monotonic() - began
            if done == 1 or passed - printed_s > 2.0 or done == len(missing):
                printed_s = passed
                left = passed / done * (len(missing) - done)
                print(f"campaign: {done}/{len(missing)} parts, {left:.0f} s left", file=sys.stderr, flush=True)
    except (RuntimeError, KilledWorker) as error:
        print(f"campaign: {error}; finished parts are kept", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"campaign: {error}; finished parts are kept", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("campaign: stopped; the same command goes on", file=sys.stderr)
        return 130
    finally:
        client.close()
        if cluster:
            cluster.close()
    return subprocess.run([asked.campaign, "merge", file, str(asked.out), *shipped]).returncode


if __name__ == "__main__":
    sys.exit(main())
