"""Synthetic people, registrations and scans, with known answers: nothing in here was measured."""

from workbench.synthetic.scan_effects import (
    Clutter,
    Crate,
    Floor,
    HalfSpace,
    Holes,
    Noise,
    Specks,
    Thing,
)
from workbench.synthetic.scanned_people import ScannedPerson, people
from workbench.synthetic.scanners import Scanner, scanners
from workbench.synthetic.scans import Joining, SimulatedScan, scan

__all__ = [
    "Clutter",
    "Crate",
    "Floor",
    "HalfSpace",
    "Holes",
    "Joining",
    "Noise",
    "ScannedPerson",
    "Scanner",
    "SimulatedScan",
    "Specks",
    "Thing",
    "people",
    "scan",
    "scanners",
]
