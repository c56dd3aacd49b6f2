"""The gym: problems with known answers, split into those for tuning and those left untouched."""
