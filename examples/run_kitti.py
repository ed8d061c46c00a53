"""Run SLAM over a KITTI sequence and compare the result with the ground truth, where there is one.

python examples/run_kitti.py path/to/kitti --sequence 04 --input 16 --out runs/04
"""

from __future__ import annotations

import argparse

import lidarlift


def main() -> None:
    """Open, run, evaluate."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kitti", help="root of KITTI odometry or raw, or one sequence")
    parser.add_argument("--sequence", help="04 (odometry), 0013 (raw); not needed where there is only one")
    parser.add_argument("--input", choices=["64", "16", "enriched"], default="16")
    parser.add_argument("--out", default="runs/kitti", help="the run folder")
    options = parser.parse_args()

    data = lidarlift.open_dataset(options.kitti, options.sequence)
    print(f"{data.name}: {len(data)} scans, sensor {data.sensor.name if data.sensor else 'unknown'}")
    run = lidarlift.run(data, input=options.input, out=options.out)
    print(f"Frames by status: {run.counts()}")
    print(f"Map: {len(run.map)} points")
    if data.ground_truth is not None:
        metrics = lidarlift.evaluate(options.out)
        print(f"ATE {metrics.ate.aligned.rmse:.3f} m over {metrics.path_length_m:.0f} m")


if __name__ == "__main__":
    main()
