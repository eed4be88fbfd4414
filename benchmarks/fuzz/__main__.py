"""The service under bodies that nobody meant: bodies that are nearly valid, then schemathesis.

    python -m benchmarks.fuzz [--bodies 10000] [--examples 2000] [--only WORD] [--out DIR]

Nearly valid bodies (tests/service/test_fuzz.py) go to every route that takes any, also to streams
line by line and to UM-Bridge: no 500, nothing that is not finite, nothing beyond 5 s of processor
time; of posteriors everything is computed that comes before the first draw. schemathesis makes
requests of the OpenAPI document and holds every answer to it, all checks, for a service whose
posteriors are quick fakes.

Both are done in pieces with seeds of their own, each a line of a table in DIR: what was interrupted
goes on where it stopped, and a piece that failed is done again. Ends with exit code 1 where one
failed, or was slower. On an empty kernel cache: NUMBA_CACHE_DIR=$(mktemp -d), and a DIR of its own.
"""

import argparse
import sys
import traceback
from pathlib import Path

from benchmarks.fuzz import documents, nearly_valid


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--examples", type=int, default=2000, help="of schemathesis, a route")
    parser.add_argument("--bodies", type=int, default=10_000, help="nearly valid, a route")
    parser.add_argument("--only", default="", metavar="WORD", help="routes that hold this")
    parser.add_argument("--out", type=Path, default=Path("out/fuzz"), metavar="DIR")
    args = parser.parse_args()
    good = True
    for target in nearly_valid.targets() if args.bodies else ():
        if args.only in target.path:
            try:
                good &= nearly_valid.sent(target, args.bodies, args.out)
            except Exception:
                traceback.print_exc()
                good = False
    if args.examples:
        good &= documents.checked(args.examples, args.only, args.out)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
