"""Compares trained policies with the PD baseline and the scan planner on the same seeded episodes: `rover evaluate`.

python training/evaluate.py runs/train/rocks-seed1 runs/train/rocks-seed2 --difficulty 1 --output runs/evaluation
"""

import typer

from rover_gym.cli.evaluate_command import evaluate

if __name__ == "__main__":
    typer.run(evaluate)
