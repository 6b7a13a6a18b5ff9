"""Regimes that break on purpose, so that a test can see that the campaign notices."""

import ctypes
import os
import time

import numpy as np

from torture.ledger import Ledger, Regime


def _hang(_random: np.random.Generator, _ledger: Ledger) -> None:
    time.sleep(1e3)


def _abort(_random: np.random.Generator, _ledger: Ledger) -> None:
    os.abort()


def _segfault(_random: np.random.Generator, _ledger: Ledger) -> None:
    ctypes.string_at(0)


def _foreign(_random: np.random.Generator, _ledger: Ledger) -> None:
    raise KeyError("nothing here")


def _sound(_random: np.random.Generator, ledger: Ledger) -> None:
    ledger.steps += 1


REGIMES = [
    Regime("on purpose: hangs", _hang, 1, limit=2.0),
    Regime("on purpose: aborts", _abort, 1),
    Regime("on purpose: segmentation fault", _segfault, 1),
    Regime("on purpose: foreign exception", _foreign, 1),
    Regime("on purpose: sound", _sound, 1),
]
