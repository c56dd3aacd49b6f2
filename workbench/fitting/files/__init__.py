"""Readers of other programs' files: keypoints of detectors, clips, and calibrated cameras."""
