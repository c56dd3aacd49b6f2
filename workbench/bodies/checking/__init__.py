"""What is wrong with the file of a body model, in sentences that say what to do about it.

A check is a function from `ModelArrays`, which reads each array by itself, to findings. To add
one, write such a function in `findings`, and a faulty file for its test; the embedded bodies must
stay without findings.
"""
