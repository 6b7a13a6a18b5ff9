"""Compares policies on the same seeded episodes: `rover evaluate`.

python training/evaluate.py runs/train/rocks-seed1 pd scan --difficulty 1 --output runs/evaluation
"""

import typer

from rover_gym.cli.evaluate_command import evaluate

if __name__ == "__main__":
    typer.run(evaluate)
