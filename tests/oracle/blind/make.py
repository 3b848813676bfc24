"""Write sets of drive logs with hidden effects: python make.py --out DIR --seed 1 --sets 24."""

import argparse
import os
import sys
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from blind import circumstance, hidden, sealed  # noqa: E402


def main():
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--out", type=Path, required=True, help="folder for set_0001, set_0002, ...")
    reader.add_argument("--seed", type=int, required=True)
    reader.add_argument("--sets", type=int, required=True)
    reader.add_argument("--only", choices=["none", *sorted(hidden.ALL)], help="hide this in every set")
    reader.add_argument("--under", choices=["any", *circumstance.NAMES], default="plain", help="how they are driven")
    reader.add_argument("--workers", type=int, default=1, help="processes")
    reader.add_argument("--answers", type=Path, help="file for the answers; default: DIR-answers.json beside DIR")
    args = reader.parse_args()
    out = args.out.resolve()
    answers = args.answers or out.with_name(f"{out.name}-answers.json")
    sets = sealed.plan(args.seed, args.sets, only=args.only, under=args.under)
    sealed.generate(out, sets, args.seed, answers, args.workers)
    print(f"{args.sets} sets in {out}; answers in {answers}, sealed by {out / sealed.SEAL}")


if __name__ == "__main__":
    main()
