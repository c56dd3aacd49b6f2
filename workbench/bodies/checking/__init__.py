"""What is wrong with the file of a body model, in sentences that say what to do about it.

To add a check, write a function from `ModelArrays` to findings in `findings`, and a faulty file for
its test; the embedded bodies must stay without findings.
"""
