"""Plant every fault and print what was noticed."""

import argparse
import csv
import dataclasses
import json
import os
import resource
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from benchmarks.mutations.faults import Fault, read_faults, wrong_with
from benchmarks.mutations.trial import LONGEST_S, Result, copied, failing_of, result_of, try_fault
from benchmarks.resumable import code_version
from service.whole_files import write_whole

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("results.csv")
COLUMNS = ("name", "kind", "file", "noticed", "by")


def run(
    faults: Sequence[Fault], root: Path, out: Path, workers: int = 1, *, named_only: bool = False
) -> dict[str, Result]:
    """Try faults that have no result yet.

    Parameters
    ----------
    faults : sequence of Fault
        What to plant.
    root, out : Path
        The tree, which stays as it is, and the folder of results.
    workers : int
        How many copies at a time.
    named_only : bool
        Whether a fault that the tests it names miss is left so, without a result.
    """
    out.mkdir(parents=True, exist_ok=True)
    results = {f.name: found for f in faults if (found := result_of(f, out)) is not None}
    left = [fault for fault in faults if fault.name not in results]
    if not left:
        return results
    copies: SimpleQueue[Path] = SimpleQueue()

    def work(fault: Fault) -> Result:
        tree = copies.get()
        try:
            result = try_fault(fault, tree, out / "cache", named_only=named_only)
        finally:
            copies.put(tree)
        if result.noticed or not named_only:
            text = json.dumps(dataclasses.asdict(result))
            write_whole(out / f"{fault.name}.json", text.encode(), private=False)
        word = f"noticed by {result.by}" if result.noticed else "SURVIVED"
        print(f"{result.seconds:7.1f} s  {fault.name}: {word}", file=sys.stderr, flush=True)
        return result

    with copied(root) as first, copied(root) as second, ThreadPoolExecutor(workers) as pool:
        for tree in (first, second)[:workers]:
            copies.put(tree)
        results |= zip((fault.name for fault in left), pool.map(work, left), strict=True)
    return results


def table(faults: Sequence[Fault], results: Mapping[str, Result]) -> str:
    """Return how many faults of each layer and kind were noticed, and the names of the others."""
    lines = ["| | planted | noticed |", "|---|---|---|"]
    for groups in ((fault.layer for fault in faults), (fault.kind for fault in faults)):
        whole: Counter[str] = Counter()
        seen: Counter[str] = Counter()
        for group, fault in zip(groups, faults, strict=True):
            whole[group] += 1
            seen[group] += results[fault.name].noticed
        lines += [f"| {name} | {whole[name]} | {seen[name]} |" for name in sorted(whole)]
    noticed = sum(results[fault.name].noticed for fault in faults)
    lines.append(f"| **all** | {len(faults)} | {noticed} ({noticed / len(faults):.1%}) |")
    survivors = [fault.name for fault in faults if not results[fault.name].noticed]
    return "\n".join([*lines, "", f"survived: {', '.join(survivors) or 'none'}"])


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutations")
    parser.add_argument("--out", type=Path, default=Path("out/mutations"))
    parser.add_argument("--only", nargs="+", metavar="NAME", help="faults to try anew")
    parser.add_argument("--workers", type=int, choices=(1, 2), default=1)
    parser.add_argument(
        "--named-only", action="store_true", help="not the fast suite where the named tests pass"
    )
    parser.add_argument("--table", action="store_true", help="what is known by now, no more runs")
    parser.add_argument("--nice", type=int, default=19, help="how low the priority is")
    parser.add_argument("--clean", action="store_true", help="run the named tests without a fault")
    asked = parser.parse_args(arguments)
    faults, out = read_faults(), asked.out.resolve()
    wrong = [reason for fault in faults if (reason := wrong_with(fault, ROOT)) is not None]
    if wrong:
        print("\n".join(wrong), file=sys.stderr)
        return 2
    os.nice(asked.nice)
    # processes inherit it, and what waits for them uses next to none
    resource.setrlimit(resource.RLIMIT_CPU, (LONGEST_S, LONGEST_S + 60))
    if asked.clean:
        tests = {test for fault in faults for test in fault.tests}
        with copied(ROOT) as tree:
            by = failing_of(tests, tree, out / "cache")
        print(f"without a fault: {by or 'all pass'}")
        return 0 if by is None else 1
    if asked.only:
        named = {fault.name: fault for fault in faults}
        faults = tuple(named[name] for name in asked.only if name in named)
        if missing := set(asked.only) - {fault.name for fault in faults}:
            parser.error(f"no such faults: {', '.join(sorted(missing))}")
        for fault in faults:
            (out / f"{fault.name}.json").unlink(missing_ok=True)
    if not asked.table:
        run(faults, ROOT, out, asked.workers, named_only=asked.named_only)
    results = {f.name: found for f in faults if (found := result_of(f, out)) is not None}
    tried = [fault for fault in faults if fault.name in results]
    print(table(tried, results))
    if len(tried) < len(faults):
        print(f"without a result: {len(faults) - len(tried)} of {len(faults)}")
    if not asked.only:
        _write(faults, results)
        print(f"at commit {code_version()}")
    return 0


def _write(faults: Sequence[Fault], results: Mapping[str, Result]) -> None:
    """Write the table of all faults, of those without a result as well."""
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for fault in faults:
            said = results.get(fault.name)
            word = "not tried" if said is None else "yes" if said.noticed else "no"
            by = "" if said is None else said.by
            writer.writerow((fault.name, fault.kind, fault.file, word, by))


if __name__ == "__main__":
    sys.exit(main())
