# SPDX-License-Identifier: Apache-2.0
"""`make accept`: the outputs of all recordings at hand become the references.

python tests/references/accept.py [NAME ...]
"""

import sys

from referenced import RECORDINGS, Absent, accept, changed, outputs


def main(names: list[str]) -> int:
    """Prints what has changed; 2 for a name that is none."""
    for name in names or RECORDINGS:
        if name not in RECORDINGS:
            print(f"no recording '{name}', allowed: {', '.join(RECORDINGS)}", file=sys.stderr)
            return 2
        try:
            answer = outputs(RECORDINGS[name]())
        except Absent as absent:
            print(f"{name}: left as it is, {absent}")
            continue
        found = changed(name, answer)
        print(f"{name}: {len(found)} changed" if found else f"{name}: as it was")
        for line in found[:10]:
            print(f"  {line}")
        if found:
            accept(name, answer)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
