"""Training the regressor of poses: `workbench/data/poses/regressor.npz`.

Run as `python -m builder.pose_regressor --out workbench/data/poses`. It takes three minutes and
needs nothing but the package and scikit-learn (the extra `learn`).
"""

import argparse
from pathlib import Path

from workbench import load_body
from workbench.fitting.pose_regressor import REGRESSOR_FILE, save_regressor
from workbench.fitting.regressor_training import train_pose_regressor
from workbench.priors.poses import shipped_mixture

PEOPLE, PASSES, HIDDEN = 30_000, 200, (320, 320)


def main() -> None:
    """Train the regressor and write it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()

    def progress(done: int, loss: float) -> None:
        if done % 10 == 0:
            print(f"{done} of {PASSES} passes, loss {loss:.5f}", flush=True)

    regressor = train_pose_regressor(
        load_body("default"),
        shipped_mixture(),
        n=PEOPLE,
        passes=PASSES,
        hidden=HIDDEN,
        progress=progress,
    )
    save_regressor(regressor, arguments.out / REGRESSOR_FILE)


if __name__ == "__main__":
    main()
