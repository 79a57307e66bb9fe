#!/usr/bin/env python3
"""Compares our machine on a subset of the paper's pairs with scikit-learn's SVC: decision values, support vectors, times.

    noisefloor-lab reproduce --corpus … --dump-subset 1000 --out subset
    ./against_sklearn.py subset

Needs numpy and scikit-learn. SVC gets the same rows, C, γ and stopping tolerance; its rows are float64, as it makes them anyhow.
"""

import argparse
import json
import os
import time
from pathlib import Path

# Dot products of long rows in two threads that wait for one another are slower than in one.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import sklearn
from sklearn.svm import SVC


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("subset", type=Path, help="folder with rows.npy and machine.json")
    parser.add_argument("--tolerance", type=float, default=1e-3, help="where SVC stops; ours stops at 1e-3 [default: %(default)s]")
    args = parser.parse_args()

    rows = np.load(args.subset / "rows.npy").astype(np.float64)
    ours = json.loads((args.subset / "machine.json").read_text())
    learned, labels = ours["learned"], np.array(ours["identical"])
    params = ours["params"]

    machine = SVC(C=params["c"], gamma=params["gamma"], kernel="rbf", tol=args.tolerance, cache_size=2000)
    begun = time.perf_counter()
    machine.fit(rows[:learned], labels[:learned])
    training = time.perf_counter() - begun
    begun = time.perf_counter()
    decisions = machine.decision_function(rows)
    query = (time.perf_counter() - begun) / len(rows)

    difference = np.abs(decisions - np.array(ours["decisions"]))
    same = (decisions > 0) == (np.array(ours["decisions"]) > 0)
    print(f"{learned} pairs of {rows.shape[1]:,} numbers learned, {len(rows) - learned} others asked about; scikit-learn {sklearn.__version__}\n")
    print("| | support vectors | training, s | query, s | right on those learned | on the others |")
    print("|---|---|---|---|---|---|")
    for name, support, train, ask, values in [
        (f"noisefloor, {ours['threads']} threads", ours["support_vectors"], ours["seconds_training"], ours["seconds_query"], np.array(ours["decisions"])),
        ("scikit-learn, 1 thread", int(machine.n_support_.sum()), training, query, decisions),
    ]:
        right = (values > 0) == labels
        print(f"| {name} | {support} | {train:.2f} | {ask:.4f} | {right[:learned].mean():.2%} | {right[learned:].mean():.2%} |")
    print(f"\nDecision values differ by at most {difference.max():.1e} (median {np.median(difference):.1e}); {same.mean():.2%} have the same sign.")


if __name__ == "__main__":
    main()
