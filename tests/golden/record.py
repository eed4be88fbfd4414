"""Record golden answers: ``python -m tests.golden.record [group | group/request ...]``.

Only on a commit whose answers are known to be right, or where a change of answers is stated: the
diff of the stored files then shows what has changed.
"""

import sys
import time

from tests.golden.groups import GROUPS
from tests.golden.machine import note
from tests.golden.plain import read, write


def main(wanted: list[str]) -> None:
    """Answer the requests that are named, all if none is, and store what they say."""
    known = {f"{group}/{name}" for group, requests in GROUPS.items() for name in requests}
    if unknown := set(wanted) - set(GROUPS) - known:
        sys.exit(f"no such group or request: {', '.join(sorted(unknown))}")
    for group, requests in GROUPS.items():
        stored = {name: answer for name, answer in read(group).items() if name in requests}
        changed = False
        for name, request in requests.items():
            if wanted and group not in wanted and f"{group}/{name}" not in wanted:
                continue
            begin = time.process_time()
            stored[name] = request()
            changed = True
            print(f"{group}/{name} {time.process_time() - begin:.2f} s")  # noqa: T201
        if changed:
            write(group, stored)
            note()


if __name__ == "__main__":
    main(sys.argv[1:])
